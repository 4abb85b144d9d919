"""Robot files: every format, in and out."""
