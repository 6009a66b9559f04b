"""The commands about recordings themselves: check, repair, export.

What they do to a recording is in `manytouch.recording` and `manytouch.sinks.exports`.
"""
