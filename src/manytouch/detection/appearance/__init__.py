"""Appearance of dots: the search for dots of unknown size, contrast, colour and layout in an image
(`survey`).

What it finds is an `Appearance` (`detection.dot_appearance`). The search for dots of a known sensor, frame by
frame, is not here but in `detection.search`.
"""
