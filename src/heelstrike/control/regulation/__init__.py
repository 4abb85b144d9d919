"""Regulation of the zero moment point by the clock of a gait."""
