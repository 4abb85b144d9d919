"""Walking that keeps its balance: whole-body control and footstep feedback."""
