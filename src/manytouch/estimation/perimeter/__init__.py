"""The method `perimeter`: the paper's depth on tracked markers, without the motion of the view.

Contacts come from the load maps in `load` and `uncalibrated`; the paper's own system is `manytouch.paper`.
"""
