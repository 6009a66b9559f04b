"""Lattices: unordered dots to rows and columns (`find`), and to numbered markers (`arrange`).

`calibration.rest` numbers the markers of the first frames by `arrange`; the tracker does not call it. Markers
that are known already, and their identities from frame to frame, are not here but in `matching`.
"""
