"""What every way through time asks of contacts: where they are, and what they do to the robot."""
