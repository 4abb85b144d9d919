"""Walks planned by the cart-table model: the zero moment point first, the joints after it."""
