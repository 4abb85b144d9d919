"""Fixed steps whose contact impulses decide the next velocity."""
