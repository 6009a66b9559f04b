"""What the commands share: options, progress and messages on the console, Ctrl-C, the viewer's address.

Nothing in here computes results.
"""
