"""The untouched sheet in the first frames: rest positions, layout, pose, noise, and doubts about them.

Mechanical properties of the sheet are not estimated here but in `calibration.sheet`.
"""
