"""Outputs to other programs: ROS 2, Foxglove, TUIO, OSC, MIDI.

`registry.open_outputs` opens them by URL. Each runs behind a bounded queue in a thread of its own
(`queued.QueuedOutput`): a slow or dead receiver costs readings of that output, which are counted, and never
delays the session.
"""
