"""Mechanics of the sheet for estimators: energy and forces of the shell, marker images, Gauss-Newton steps.

It does not contain the splines (`geometry.spline`), the objective of the inversion (`estimation.mechanics`)
or the finite elements of the ground truth (`simulation`).
"""
