"""From requirements to a sensor: its dimensions, its predicted accuracy and its printable parts.

The calibration of a built sensor is in `manytouch.calibration`.
"""
