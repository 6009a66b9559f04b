"""The file format of recordings (MCAP): encoding, writing and reading of frames, readings and sessions.

When to record, in which thread, and how to show a recording is decided in `sinks`, `sources` and `session`.

    /camera     foxglove.CompressedImage (protobuf): JPEG as the camera delivered it, else PNG; no data if the
                frame could not be decoded. All frames that arrived, also those that were not processed.
    /reading    JSON: one per processed frame, with the main numbers and the outlines readable, and all values
                packed: numbers in single precision or less, see `packed.SIGNIFICANT_BITS`
    /surface    foxglove.PointCloud (protobuf): the markers in the sheet frame, with depth
    /session    JSON: sensor, method, parameters, versions; at the start and after every change
    /calibration, /transform
                foxglove.CameraCalibration and FrameTransform (protobuf): intrinsic parameters and pose of the
                camera; with the first frame after every /session, unless the sensor has several views
    /log        foxglove.Log (protobuf): messages of the session

The sequence of a message is the index of its frame; its log time is the start of the recording plus the
timestamp of the frame. Each message is a chunk of its own, compressed with zstd and with a checksum, which is
passed to the operating system at once: a killed process or a damaged byte costs one message. The session is
repeated at the end. Recordings of schema 1, with arrays bit for bit in base64, are read too.
"""

CAMERA, READING, SURFACE, SESSION, LOG = "/camera", "/reading", "/surface", "/session", "/log"
CALIBRATION, TRANSFORM = "/calibration", "/transform"
SUFFIX = ".mcap"
PROFILE = "manytouch"
SCHEMA = 2
