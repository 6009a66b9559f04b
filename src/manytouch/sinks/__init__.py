"""Receivers of readings: files, pictures, recordings, the viewer, outputs to other programs, and exports.

A sink has `write(reading)` and `close()` (`pipeline.Sink`); which ones a run uses is decided in
`manytouch.session`. `contact_outlines` is what the pictures and the viewer share.
"""
