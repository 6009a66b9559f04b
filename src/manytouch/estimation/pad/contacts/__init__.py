"""From fitted patches to contacts of a pad: the shape of its face, the depth under a patch, and deviations.

Fitting the patches to the marker images is not inside; see `patch_fit`.
"""
