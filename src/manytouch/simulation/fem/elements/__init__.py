"""Hexahedra of the sheet: mesh, material, nodal forces and tangents, sampling of the camera-side face.

Contact and the solution of the equations are in `fem.contact` and `fem.solver`.
"""
