"""What a simulation writes: frames, sensor file, ground truth, and the table of its presses."""
