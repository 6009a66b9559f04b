"""The sheet as a shear-deformable shell that is solved within a frame, for indenters that a user moves.

The 3-D solid of built-in scenes and of the accuracy suite is in `fem`.
"""
