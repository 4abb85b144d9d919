"""Small convex quadratic programmes, solved in compiled code and certified."""
