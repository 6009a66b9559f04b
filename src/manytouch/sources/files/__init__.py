"""Sources that read files: videos, images, folders of images, and recordings.

Results and recordings are written by `manytouch.sinks`, not here.
"""
