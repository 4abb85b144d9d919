"""What can be asked of a robot in space in a state, each written once for numbers and symbols."""
