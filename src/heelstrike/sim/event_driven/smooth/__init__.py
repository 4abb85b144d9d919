"""A smooth phase: its contacts and their forces, its motion, and what would end it."""
