"""Geometry of camera, sheet and layout: projection, neighbours, splines, and surfaces sampled at any point.

It computes nothing from images, which is detection's part, and no forces, which is that of mechanics; where a
spline carries forces, their pressure is sampled like its shape.
"""
