"""What small errors do in a motion that was simulated."""
