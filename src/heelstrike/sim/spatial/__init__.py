"""Time stepping of robots in space, and the run it leaves behind."""
