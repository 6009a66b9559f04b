"""What a live session does between two frames: the queue of commands, tare, contact ids,
and the thread that prepares what a command has changed.

The commands themselves are values, in `manytouch.values.commands`.
"""
