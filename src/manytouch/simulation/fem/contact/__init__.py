"""Rigid indenters as signed distances, and their contact with the touched face: penalty and friction.

Equilibrium is found in `fem.solver`.
"""
