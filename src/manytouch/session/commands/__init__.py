"""What a live session does between two frames: the queue of commands, tare, tuning and contact ids.

The commands themselves are values, in `manytouch.values.commands`.
"""
