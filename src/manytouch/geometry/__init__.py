"""Geometry of camera, sheet and layout: projection, neighbours, splines, and surfaces sampled at any point.

It computes nothing from images, which is detection's part, and no forces, which is that of mechanics; where a
spline carries forces, their pressure is sampled like its shape. Refraction by the window of a pad is exact in
`refraction`; `calibration/rest/pose.py` has its approximation near the axis, from which a pose is fitted.
"""
