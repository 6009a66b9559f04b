"""The peers: OpenCV's tools, default and tuned by hand, and trackpy and laptrack where they are installed.

Each is used as well as we could: thresholds and sizes are taken from the first frame, outside the time.
"""

from collections.abc import Callable, Iterator
from importlib.util import find_spec

import cv2
import numpy as np
from rounds import Answer, Footage, Method
from scipy.spatial import cKDTree

from manytouch.geometry.camera import camera_matrix
from manytouch.values import Camera

INSTALL = "pip install trackpy laptrack"
Run = Callable[[int], Answer]


class MarkerTrackerState:
    """Identities by the nearest dot of the frame before; the first frame's are given."""

    def __init__(self, footage: Footage) -> None:
        self.gate_px = 0.45 * footage.course.pitch_px
        self.centre_px = footage.course.centre_px[0]
        self.marker = np.arange(len(self.centre_px))

    def __call__(self, centre_px: np.ndarray) -> Answer:
        distance_px, nearest = cKDTree(self.centre_px).query(centre_px, distance_upper_bound=self.gate_px)
        near = np.isfinite(distance_px)
        self.marker = np.where(near, self.marker[np.minimum(nearest, len(self.marker) - 1)], -1)
        self.centre_px = centre_px
        return Answer(centre_px=centre_px, marker=self.marker)


def copying(footage: Footage) -> Run:
    """Reads every pixel once, writes it once."""
    buffer = np.empty_like(footage.frames[0].image)

    def run(index: int) -> Answer:
        np.copyto(buffer, footage.frames[index].image)
        return Answer()

    return run


def contours(footage: Footage) -> Run:
    """Fixed threshold, outer contours, their moments; identities by nearest, points undistorted."""
    level, least_px2 = _threshold(footage), 0.3 * _dot_px2(footage)
    follow, camera = MarkerTrackerState(footage), footage.course.sensor.camera
    binary = np.empty_like(footage.frames[0].image)

    def run(index: int) -> Answer:
        cv2.threshold(footage.frames[index].image, level, 255, cv2.THRESH_BINARY, dst=binary)
        found, _ = cv2.findContours(binary, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        moments = [cv2.moments(contour) for contour in found]
        centre_px = np.array(
            [(m["m10"] / m["m00"], m["m01"] / m["m00"]) for m in moments if m["m00"] > least_px2]
        )
        _straight(camera, centre_px)
        return follow(centre_px)

    return run


def components(footage: Footage) -> Run:
    """Fixed threshold, connected components with statistics; identities by nearest, points undistorted."""
    return _components(footage, 1)


def components_of_half(footage: Footage) -> Run:
    """The same on the image reduced to half its width and height: coarser, but faster."""
    return _components(footage, 2)


def _components(footage: Footage, factor: int) -> Run:
    level, least_px2 = _threshold(footage), 0.3 * _dot_px2(footage) / factor**2
    follow, camera = MarkerTrackerState(footage), footage.course.sensor.camera
    height, width = footage.frames[0].image.shape
    small = np.empty((height // factor, width // factor), dtype=np.uint8)
    binary = np.empty_like(small)

    def run(index: int) -> Answer:
        image = footage.frames[index].image
        if factor > 1:
            image = cv2.resize(image, small.shape[::-1], dst=small, interpolation=cv2.INTER_AREA)
        cv2.threshold(image, level, 255, cv2.THRESH_BINARY, dst=binary)
        _, _, stats, middle = cv2.connectedComponentsWithStatsWithAlgorithm(
            binary, 8, cv2.CV_32S, cv2.CCL_BBDT
        )
        big = stats[1:, cv2.CC_STAT_AREA] > least_px2
        centre_px = (middle[1:][big] + 0.5) * factor - 0.5
        _straight(camera, centre_px)
        return follow(centre_px)

    return run


def blob_default(footage: Footage) -> Run:
    """SimpleBlobDetector with its default parameters, except that dots are light."""
    parameters = cv2.SimpleBlobDetector_Params()
    parameters.blobColor = 255
    return _blob(footage, parameters)


def blob_tuned(footage: Footage) -> Run:
    """SimpleBlobDetector with one threshold and no filter but that of area."""
    return _blob(footage, _tuned_blob(footage))


def blobs_followed(footage: Footage) -> Run:
    """The tuned blob detector, whose contours never leave C++, as a whole chain: undistorted, by nearest."""
    detect, follow = blob_tuned(footage), MarkerTrackerState(footage)
    camera = footage.course.sensor.camera

    def run(index: int) -> Answer:
        centre_px = np.asarray(detect(index).centre_px, dtype=np.float64)
        _straight(camera, centre_px)
        return follow(centre_px)

    return run


def _blob(footage: Footage, parameters: "cv2.SimpleBlobDetector_Params") -> Run:
    detector = cv2.SimpleBlobDetector_create(parameters)

    def run(index: int) -> Answer:
        found = detector.detect(footage.frames[index].image)
        return Answer(centre_px=cv2.KeyPoint_convert(found))

    return run


def _tuned_blob(footage: Footage) -> "cv2.SimpleBlobDetector_Params":
    parameters = cv2.SimpleBlobDetector_Params()
    parameters.blobColor = 255
    level = _threshold(footage)
    parameters.minThreshold, parameters.maxThreshold, parameters.thresholdStep = level, level + 1.0, 2.0
    parameters.minRepeatability = 1
    parameters.minDistBetweenBlobs = 0.5 * footage.course.pitch_px
    parameters.minArea, parameters.maxArea = 0.3 * _dot_px2(footage), 3.0 * _dot_px2(footage)
    parameters.filterByConvexity = parameters.filterByInertia = parameters.filterByColor = False
    return parameters


def flow_default(footage: Footage) -> Run:
    """Pyramidal Lucas-Kanade flow with OpenCV's parameters."""
    return _flow(footage)


def flow_level_0(footage: Footage) -> Run:
    """The same without a pyramid and with a window of the dots' size."""
    side = 2 * round(1.3 * footage.course.radius_px) + 1
    return _flow(footage, winSize=(side, side), maxLevel=0)


def _flow(footage: Footage, **options: object) -> Run:
    course = footage.course
    last = {"index": 0, "point": course.centre_px[0].astype(np.float32)[:, None]}
    markers = np.arange(len(last["point"]))

    def run(index: int) -> Answer:
        # at the turn of the footage it gets the truth again, for errors add up
        if last["index"] == 0:
            last["point"] = course.centre_px[0].astype(np.float32)[:, None]
        before = footage.frames[last["index"]].image
        point, status, _ = cv2.calcOpticalFlowPyrLK(
            before, footage.frames[index].image, last["point"], None, **options
        )
        last["index"], last["point"] = index, point
        return Answer(centre_px=point[:, 0], marker=np.where(status[:, 0] == 1, markers, -1))

    return run


def circles_grid(footage: Footage) -> Run:
    """OpenCV's finder of circle grids, with clustering and the tuned blob detector: all or nothing."""
    rows, columns = footage.course.sensor.layout.shape
    detector = cv2.SimpleBlobDetector_create(_tuned_blob(footage))
    flags = cv2.CALIB_CB_SYMMETRIC_GRID | cv2.CALIB_CB_CLUSTERING

    def run(index: int) -> Answer:
        found, centre_px = cv2.findCirclesGrid(
            footage.frames[index].image, (columns, rows), flags=flags, blobDetector=detector
        )
        return Answer(centre_px=centre_px.reshape(-1, 2) if found else np.zeros((0, 2)))

    return run


def trackpy_locate(footage: Footage) -> Run:
    """trackpy.locate: band-pass, maxima, refined centroids."""
    import trackpy

    trackpy.quiet()
    course = footage.course
    diameter = 2 * int(course.radius_px + 1.5) + 1
    options = {"separation": 0.6 * course.pitch_px, "engine": "numba"}
    first = trackpy.locate(footage.frames[0].image, diameter, topn=len(course.contrast), **options)
    minmass = 0.5 * float(np.median(first["mass"]))

    def run(index: int) -> Answer:
        found = trackpy.locate(footage.frames[index].image, diameter, minmass=minmass, **options)
        return Answer(centre_px=found[["x", "y"]].to_numpy())

    return run


def trackpy_link(footage: Footage) -> Run:
    """trackpy's linking alone, of true centres."""
    import trackpy

    course = footage.course
    waiting: list[np.ndarray] = []

    def feed() -> Iterator[np.ndarray]:
        while True:
            yield waiting.pop()

    linked = trackpy.link_iter(feed(), 0.45 * course.pitch_px)

    def run(index: int) -> Answer:
        waiting.append(course.centre_px[index])
        _, number = next(linked)
        return Answer(centre_px=course.centre_px[index], marker=np.asarray(number))

    return run


def laptrack_link(footage: Footage) -> Run:
    """laptrack's linking alone, of true centres of two frames."""
    from laptrack import LapTrack

    course = footage.course
    linker = LapTrack(cutoff=(0.45 * course.pitch_px) ** 2, gap_closing_cutoff=False)
    before = [course.centre_px[0]]

    def run(index: int) -> Answer:
        tree = linker.predict([before[0], course.centre_px[index]])
        before[0] = course.centre_px[index]
        marker = np.full(len(before[0]), -1)
        for (_, source), (_, target) in tree.edges():
            marker[target] = source
        return Answer(centre_px=before[0], marker=marker)

    return run


def others() -> tuple[list[Method], list[str]]:
    """The peers that can run here, and sentences about those that cannot."""
    methods = [
        Method(name="copy of the frame", does="every byte read and written", prepare=copying),
        Method(
            name="OpenCV, tuned: contours",
            does="threshold, findContours, moments, undistortPoints, nearest",
            prepare=contours,
        ),
        Method(
            name="OpenCV, tuned: blobs",
            does="tuned SimpleBlobDetector, undistortPoints, nearest",
            prepare=blobs_followed,
        ),
        Method(
            name="OpenCV, tuned: components",
            does="threshold, connectedComponentsWithStats (BBDT), undistortPoints, nearest",
            prepare=components,
        ),
        Method(
            name="OpenCV, tuned: components at half size",
            does="the same, reduced to half first",
            prepare=components_of_half,
        ),
        Method(name="SimpleBlobDetector, tuned", does="dots only", prepare=blob_tuned),
        Method(name="SimpleBlobDetector, default", does="dots only", prepare=blob_default),
        Method(name="PyrLK, level 0", does="flow of known dots", prepare=flow_level_0),
        Method(name="PyrLK, default", does="flow of known dots", prepare=flow_default),
        Method(name="findCirclesGrid", does="dots and grid, clustering", prepare=circles_grid, most=100),
    ]
    missing = []
    if find_spec("trackpy") is None:
        missing.append(f"trackpy is not installed and was left out: {INSTALL}")
    else:
        methods += [
            Method(name="trackpy.locate", does="dots only", prepare=trackpy_locate),
            Method(name="trackpy.link", does="identities of given dots", prepare=trackpy_link),
        ]
    if find_spec("laptrack") is None:
        missing.append(f"laptrack is not installed and was left out: {INSTALL}")
    else:
        methods.append(
            Method(name="laptrack", does="identities of given dots, two frames", prepare=laptrack_link)
        )
    return methods, missing


def _threshold(footage: Footage) -> float:
    """Otsu's level of the first frame's dots and their surroundings."""
    level, _ = cv2.threshold(footage.frames[0].image, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    return float(level)


def _dot_px2(footage: Footage) -> float:
    return float(np.pi * footage.course.radius_px**2)


def _straight(camera: Camera, centre_px: np.ndarray) -> np.ndarray:
    """What a chain does with its points instead of remapping the image."""
    return cv2.undistortPoints(centre_px[:, None], camera_matrix(camera), camera.distortion)
