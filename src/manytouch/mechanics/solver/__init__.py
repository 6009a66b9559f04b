"""Linearisation, normal equations and posterior of the sheet's coefficients, and the band matrices they need.

It does not contain the weights of markers and forces, which are parameters of the inversion.
"""
