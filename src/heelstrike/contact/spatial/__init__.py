"""The contact problem in space: blocks of one to three rows, their solvers and certificates."""
