"""Matching: the dots of one frame to the nodes of the lattice graph, with compiled kernels.

Guesses, growth along the lattice, verification and the resolution of shifts are inside. What is kept from
frame to frame is not: that is the state of the tracker. Gates: `identify` (first matches), `growth`
(neighbours), `verification` (errors after growth), `frame_checks` (exterior nodes).

No gate limits the motion of a marker between two frames, so that presses may be fast: a dot far from its
guess is found by growth from the markers around it. A limit would be placed at the end of `identify`, its
number in `IdentificationParameters`.
"""
