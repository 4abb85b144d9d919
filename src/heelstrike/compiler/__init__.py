"""Kernels, bundles and straight-line code: the only room that knows Numba from inside."""
