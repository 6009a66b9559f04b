"""Pretension, bending factor, thickness and Young's modulus of a sheet from presses at known places.

Inside are the press tables, the fit and the clamp line; detection and tracking of the markers are not.
"""
