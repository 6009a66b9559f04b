"""The file format of recordings (MCAP): encoding, writing and reading of frames, readings and sessions.

When to record, in which thread, and how to show a recording is decided in `sinks`, `sources` and `session`.

    /camera     foxglove.CompressedImage (protobuf): JPEG as the camera delivered it, else PNG; no data if the
                frame could not be decoded. All frames that arrived, also those that were not processed.
    /reading    JSON: one per processed frame, with the main numbers readable and all values bit for bit
    /surface    foxglove.PointCloud (protobuf): the markers in the sheet frame, with depth
    /session    JSON: sensor, method, parameters, versions; at the start and after every change
    /calibration, /transform
                foxglove.CameraCalibration and FrameTransform (protobuf): intrinsic parameters and pose of the
                camera; with the first frame after every /session
    /log        foxglove.Log (protobuf): messages of the session

The sequence of a message is the index of its frame; its log time is the start of the recording plus the
timestamp of the frame. Nothing is compressed and chunks are small, so that a truncated file is readable.
"""

CAMERA, READING, SURFACE, SESSION, LOG = "/camera", "/reading", "/surface", "/session", "/log"
CALIBRATION, TRANSFORM = "/calibration", "/transform"
SUFFIX = ".mcap"
PROFILE = "manytouch"
SCHEMA = 1
