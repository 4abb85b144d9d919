"""What may be asked of a robot: each query written once, for numbers and for symbols."""
