"""Regions of contacts: area, equivalent ellipse, shape and outline of a fitted pressure.

It does not contain the fit of the pressure (`evidence`) or the joining of rigid faces (`rigid_faces`).
"""
