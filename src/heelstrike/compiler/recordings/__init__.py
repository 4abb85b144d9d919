"""What kernels do to their arguments, recorded as data: as a tape, and as text in C."""
