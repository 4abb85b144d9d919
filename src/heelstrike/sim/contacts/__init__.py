"""What every simulation method asks of contacts: where they are, and what they do to the robot."""
