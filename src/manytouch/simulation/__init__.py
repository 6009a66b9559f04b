"""Simulated sensors with ground truth: the pressed sheet, its scenes, and the images of its camera.

It shares no mechanics, detection, tracking or estimation with the methods that are evaluated on it.
"""
