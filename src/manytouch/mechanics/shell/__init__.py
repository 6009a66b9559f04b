"""Energy, forces and tangent of the sheet as a shell, and its equilibrium under given loads.

It does not contain the markers on the sheet or the inversion from measurements.
"""
