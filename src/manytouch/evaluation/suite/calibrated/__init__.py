"""Sensors that are calibrated with simulated presses, as a user does it."""
