"""What notebooks show of robots, gaits, runs and grounds: small tables and pictures."""
