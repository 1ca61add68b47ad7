"""Numerical kernels, compiled to machine code (numba), and the records that they work on."""
