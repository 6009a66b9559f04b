"""Receivers of readings: files, pictures, recordings, the viewer.

A sink has `write(reading)` and `close()` (`pipeline.Sink`); which ones a run uses is decided in
`manytouch.session`. `contact_outlines` is what the pictures and the viewer share.
"""
