"""What the commands share: options, progress and messages on the console, Ctrl-C, the viewer's address.

`run` of a rig file is here too. Nothing in here computes results.
"""
