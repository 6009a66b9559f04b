"""Soft pads that are bonded to a rigid window: their linear elasticity.

No contacts and no estimation: see `estimation.pad`.
"""
