"""Matching: the dots of one frame to the nodes of the lattice graph, with compiled kernels.

Guesses, growth along the lattice, verification and the resolution of shifts are inside. What is kept from
frame to frame is not: that is the state of the tracker. Gates: `identify` (first matches), `growth`
(neighbours), `verification` (errors after growth), `frame_checks` (exterior nodes).
"""
