"""Readings as standard messages of ROS 2, without ROS: types and CDR bytes by rosbags.

Units follow REP 103: metres, newtons, newton metres, pascals, radians. Frames: `NAME_sheet` as the sheet
frame of manytouch (z out of the sensor, a press has force z < 0),
`NAME_camera` as an optical frame (REP 105).
"""
