"""The method `perimeter`: the paper's depth on tracked markers, after the motion of the view is removed.

Contacts come from the load maps in `load` and `uncalibrated`; the paper's own system is `manytouch.paper`.
"""
