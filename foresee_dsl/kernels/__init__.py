"""Numerical kernels, which numba compiles to machine code, and the records that they work on."""
