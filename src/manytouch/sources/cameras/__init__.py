"""Live sources: cameras through OpenCV, Motion JPEG and other streams, each read in a thread of its own.

Requests to a camera's driver and its arrival clock are here; the pace of processing and dropped frames are
counted in `manytouch.session`.
"""
