"""Lattices: unordered dots to rows and columns (`find`), and to numbered markers (`arrange`).

Markers that are known already, and their identities from frame to frame, are not here but in `matching`.
"""
