"""What a controller is to a simulation, and what it may do."""
