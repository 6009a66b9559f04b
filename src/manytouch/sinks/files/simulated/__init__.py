"""What a simulation writes: frames, sensor file, ground truth, and the table of its presses.

Results of an estimation are not written here but by the other modules of `sinks.files`.
"""
