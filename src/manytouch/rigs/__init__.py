"""Several sensors as one: a process per sensor, one stream of contacts in the rig's frame, one recording.

A sensor is processed as `manytouch.session` processes one; nothing in here looks at an image.
"""
