"""Learning: tasks on exact contact, environments of Gymnasium for them, and a trainer."""
