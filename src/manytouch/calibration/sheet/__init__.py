"""Pretension, bending factor, thickness and Young's modulus of a sheet from presses at known places.

Inside are the press tables and the fit; the outline of the sheet (`calibration.outline`), detection and
tracking of the markers are not.
"""
