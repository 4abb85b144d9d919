"""Measured tosses of a cube, foretold by heelstrike and other engines."""
