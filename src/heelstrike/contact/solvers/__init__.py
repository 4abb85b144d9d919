"""What solves contact problems: one idea a file, every answer certified."""
