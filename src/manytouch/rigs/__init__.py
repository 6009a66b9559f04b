"""Several sensors as one: a process per sensor, contacts of all in rig coordinates, one recording.

A sensor is processed as `manytouch.session` processes one; nothing in here looks at an image.
"""
