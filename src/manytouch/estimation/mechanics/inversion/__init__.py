"""The sheet of a sensor and its inversion: from marker images to shape, nodal forces and what is unknown.

Contacts are found from the nodal forces in `clusters`.
"""
