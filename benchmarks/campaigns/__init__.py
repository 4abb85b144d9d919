"""What campaigns cost, and whether any kind of death loses a trial."""
