"""Recordings: MCAP files of frames as they came, readings, and what made them.

    /camera     foxglove.CompressedImage (protobuf): JPEG as the camera gave it, else PNG; no data where there
                was no picture. Every frame that arrived, also those that nobody had time to read.
    /reading    JSON: one per frame that was read, with numbers for people and all values to the last bit
    /surface    foxglove.PointCloud (protobuf): the markers in the sheet's frame, with depth
    /session    JSON: sensor, method, parameters, versions; at the start and after every change
    /calibration, /transform
                foxglove.CameraCalibration and FrameTransform (protobuf): the lens, and where the sheet lies
                before the camera; with the first frame after every /session
    /log        foxglove.Log (protobuf): what there was to tell

A message's sequence is the number of its frame; its log time is the start of the recording plus the frame's
timestamp. Nothing is compressed and every chunk is small, so a file that was cut off is good up to there.
"""

CAMERA, READING, SURFACE, SESSION, LOG = "/camera", "/reading", "/surface", "/session", "/log"
CALIBRATION, TRANSFORM = "/calibration", "/transform"
SUFFIX = ".mcap"
PROFILE = "manytouch"
SCHEMA = 1
