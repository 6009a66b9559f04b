"""The paper, step by step: every intermediate result of its method on one frame, as pictures and a page.

`collect` runs the method on an input, `pictures` draws, `page` writes.
The method itself is in `manytouch.paper`.
"""
