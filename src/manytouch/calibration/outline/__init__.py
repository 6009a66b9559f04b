"""The outline of a sheet or pad: measured in images of the untouched sheet, and its place in a sensor.

What is estimated from presses is in `calibration.sheet`, pose and layout in `calibration.rest`.
"""
