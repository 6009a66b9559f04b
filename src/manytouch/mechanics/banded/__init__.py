"""Symmetric band matrices: memory, Cholesky factor and solutions, and the product that fills them in tiles.

It does not contain anything about sheets; assembly is in `shell` and `solver`.
"""
