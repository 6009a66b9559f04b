"""Codecs of video that predict pictures from other ones, and lose what differs by little."""

_PREDICTING = frozenset(
    (
        *("H264", "X264", "AVC1", "AVC3"),
        *("H265", "HEVC", "HVC1", "HEV1", "X265"),
        *("VP80", "VP90", "VP09", "AV01"),
        *("FMP4", "MP4V", "XVID", "DIVX", "DX50", "MP41", "MP42", "MP43", "DIV3"),
        *("MPG1", "MPG2", "MPEG", "WMV1", "WMV2", "WMV3", "WVC1", "VC-1"),
        *("H261", "H263", "FLV1", "THEO"),
    )
)
"""Codes of H.264, H.265, VP8, VP9, AV1, MPEG-4 (and its kinds of Microsoft), MPEG-1 and 2, Windows Media
Video, H.261, H.263 and Theora, in capitals. OpenCV states a code of FFmpeg's list for AVI, or the name."""


def predicts_pictures(code: float) -> bool:
    """Whether a codec predicts pictures from other ones, by the code that OpenCV states (CAP_PROP_FOURCC).

    H.264 without loss has the same code as with. Codecs that store each picture by itself, such as Motion
    JPEG, FFV1 and PNG, and codes that are not known do not predict.
    """
    if not 0.0 < code < 2.0**32:
        return False
    return int(code).to_bytes(4, "little").decode("latin-1").upper() in _PREDICTING
