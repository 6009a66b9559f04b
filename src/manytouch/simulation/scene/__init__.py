"""Scenes: bodies on their trajectories, the states of the sheet under them, and the sheet in time.

Scene files are read here; states are solved in `fem` or, while a user presses, in `shell`.
"""
