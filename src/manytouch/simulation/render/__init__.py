"""Images of the dots: their ellipses, light, noise, blur, and faults of print and camera.

The positions of the dots come from the sheet in `scene`; the true centres of their images are computed here.
"""
