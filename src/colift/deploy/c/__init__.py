"""Kernels of the controllers in C99, translated from their Python source."""
