"""What a session does between two frames: the queue of commands, tare, contact ids, the thread that prepares
what a command has changed, and the states from which frames continue.

A live session and a playback use all of it but tare and `touched_tares`, which only a live session has, and
`frame_processor`, which only a playback has: it processes the frames of a timeline in any order of requests.
The commands themselves are values, in `manytouch.values.commands`.
"""
