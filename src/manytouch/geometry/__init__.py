"""Geometry of camera, sheet and layout: projection, neighbours, splines, and surfaces sampled at any point.

It computes nothing from images and assumes nothing about forces: that is detection's and mechanics' part.
"""
