"""Equilibrium under a loading: balance of forces, Newton's method, and the multifrontal linear solver.

Elements and contact forces come from `fem.elements` and `fem.contact`.
"""
