"""What a run in space says: motion, zero moment point, support polygon, figures on one page."""
