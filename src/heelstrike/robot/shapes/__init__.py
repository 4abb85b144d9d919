"""What links look like in the plane: outlines, and the corners of them that matter."""
