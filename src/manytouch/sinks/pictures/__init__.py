"""Images for people: the annotated camera image, and the surface in three dimensions.

Interactive views are in `manytouch.sinks.viewer`.
"""
