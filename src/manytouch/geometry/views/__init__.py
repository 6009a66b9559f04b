"""Several cameras on one sheet: the sensor of each view, and the markers of all views as those of one.

Each view is detected and tracked as a camera of its own; that is not in here.
"""
