"""Contacts, forces and shape of pads bonded to a window, from the mechanics of the pad and few parameters.

The pad's elasticity is in `mechanics.pad`; what clamped sheets use too is in `estimation`,
`estimation.mechanics` and, for a frame with too few markers, `estimation.perimeter`.
"""
