"""Receivers of readings: files, pictures, recordings, the viewer, outputs to other programs, and exports.

A sink has `write(reading)` and `close()` (`pipeline.Sink`); which ones a run uses is decided in
`manytouch.session`. Not sinks, but what several of them share, are `contact_outlines` (pictures, viewer),
`clear_forces` (summary, pictures) and `display_grid` (pictures, files, exports, viewer, publishers, and
`analysis`).
"""
