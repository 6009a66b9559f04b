"""Displacements and images of the markers for given coefficients of the sheet, and their derivatives.

It does not contain the detection or tracking of markers in images.
"""
