"""What contact does to a robot: accelerations, torques and forces at one instant."""
