"""Left and right: which parts mirror each other, and how they are made to."""
