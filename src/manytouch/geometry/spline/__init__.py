"""Cubic B-splines along one axis (`basis`) and on a rectangle of the sheet (`patch`).

What a shape costs in energy is in `manytouch.mechanics`.
"""
