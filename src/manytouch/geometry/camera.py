"""Between the sheet and the image: projection, its inverse on the sheet's plane, distortion.

All functions take (n, 2) pixels or (n, 3) millimetres and work on whole arrays. Model: OpenCV's
pinhole (Brown-Conrady; D. C. Brown, "Close-range camera calibration", 1971) and fisheye
(Kannala and Brandt, doi:10.1109/TPAMI.2006.153). With several views, a point is projected into the view that
shows it most centrally (`view_of`), and a pixel belongs to the view whose picture it lies in.
"""

import cv2
import numpy as np

from manytouch.values import Camera
from manytouch.values.arrays import Counts, Mask, Points2, Points3

_MOST_REFINEMENTS = 12
"""Each improves a ray by a factor of about 3 where the distortion moves it by a fifth."""


def camera_matrix(camera: Camera) -> np.ndarray:
    """(3, 3) matrix of the intrinsics (equation 9 of the paper)."""
    return np.array([[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]])


def cam_from_sheet(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and translation (3,): x_cam = R x_sheet + t.

    The nominal pose is rotation 0 and t = (0, 0, d): the sheet's z points away from the camera, so a
    pressed point (z < 0) comes nearer to it.
    """
    rotation, _ = cv2.Rodrigues(camera.rotation_vector)
    return np.asarray(rotation, dtype=np.float64), camera.translation_mm


def project(camera: Camera, point_mm: Points3) -> Points2:
    """Pixels of points in the sheet frame."""
    if len(point_mm) == 0:
        return np.zeros((0, 2))
    if camera.views:
        number, chosen = view_of(camera, point_mm), np.empty((len(point_mm), 2))
        for index, view in enumerate(camera.views):
            chosen[number == index] = project(view.in_frame, point_mm[number == index])
        return chosen
    function = cv2.fisheye.projectPoints if camera.model == "fisheye" else cv2.projectPoints
    pixels, _ = function(
        np.ascontiguousarray(point_mm, dtype=np.float64).reshape(-1, 1, 3),
        camera.rotation_vector.reshape(3, 1),
        camera.translation_mm.reshape(3, 1),
        camera_matrix(camera),
        camera.distortion,
    )
    projected: Points2 = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    return projected


def view_of(camera: Camera, point_mm: Points3) -> Counts:
    """Number (n,) of the view that shows each point of the sheet frame most centrally; 0 for one camera.

    The distance from the centre of a picture counts along each axis as a share of the picture. A view in
    which a point is outside of the picture comes after all others.
    """
    distance = np.zeros((max(len(camera.views), 1), len(point_mm)))
    for off, view in zip(distance, camera.views, strict=False):
        size_px = np.array([view.camera.width_px, view.camera.height_px])
        from_centre = np.abs((project(view.camera, point_mm) + 0.5) / size_px - 0.5)
        off[:] = (from_centre**2).sum(axis=1) + (from_centre.max(axis=1) > 0.5)
    number: Counts = np.argmin(distance, axis=0)
    return number


def ray(camera: Camera, pixel: Points2) -> Points2:
    """Undistorted normalised image coordinates x/z, y/z in the camera frame; NaN stays NaN."""
    if len(pixel) == 0:
        return np.zeros((0, 2))
    points = np.ascontiguousarray(pixel, dtype=np.float64).reshape(-1, 1, 2)
    if camera.model == "pinhole" and not camera.distortion.any():
        centre = np.array([camera.cx_px, camera.cy_px])
        plain: Points2 = (points.reshape(-1, 2) - centre) / np.array([camera.fx_px, camera.fy_px])
        return plain
    matrix = camera_matrix(camera)
    if camera.model == "fisheye":
        wide: Points2 = np.asarray(cv2.fisheye.undistortPoints(points, matrix, camera.distortion))
        return wide.reshape(-1, 2)
    found = np.asarray(cv2.undistortPoints(points, matrix, camera.distortion)).reshape(-1, 2)
    return _refined(camera, points.reshape(-1, 2), found)


def _refined(camera: Camera, pixel: Points2, found: Points2) -> Points2:
    """Rays (n, 2) of a pinhole camera that are improved until their pixels agree.

    OpenCV ends after five iterations, up to 0.03 px off in corners of a picture with a distortion of -0.2.
    A step is kept only where it comes nearer to the pixel.
    """
    focal_px = np.array([camera.fx_px, camera.fy_px])
    off_px = _seen_at(camera, found) - pixel
    for _ in range(_MOST_REFINEMENTS):
        tried = found - off_px / focal_px
        tried_px = _seen_at(camera, tried) - pixel
        is_nearer = (np.square(tried_px).sum(axis=1) < np.square(off_px).sum(axis=1))[:, None]
        if not is_nearer.any():
            break
        found, off_px = np.where(is_nearer, tried, found), np.where(is_nearer, tried_px, off_px)
    return found


def _seen_at(camera: Camera, direction: Points2) -> Points2:
    """Pixels of rays x/z, y/z (n, 2)."""
    point = np.column_stack([direction, np.ones(len(direction))]).reshape(-1, 1, 3)
    zero = np.zeros((3, 1))
    pixels, _ = cv2.projectPoints(point, zero, zero, camera_matrix(camera), camera.distortion)
    return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


def onto_plane(camera: Camera, pixel: Points2, z_mm: float = 0.0) -> Points3:
    """Where the rays of pixels meet the plane z = z_mm of the sheet frame."""
    if camera.views:
        left_px = np.array([view.left_px for view in camera.views])
        number = np.maximum(np.searchsorted(left_px - 0.5, pixel[:, 0], side="right") - 1, 0)
        met_mm = np.empty((len(pixel), 3))
        for index, view in enumerate(camera.views):
            met_mm[number == index] = onto_plane(view.in_frame, pixel[number == index], z_mm)
        return met_mm
    rotation, translation = cam_from_sheet(camera)
    direction = np.column_stack([ray(camera, pixel), np.ones(len(pixel))]) @ rotation
    origin = -translation @ rotation
    distance = (z_mm - origin[2]) / direction[:, 2]
    point_mm: Points3 = origin + distance[:, None] * direction
    return point_mm


def is_in_image(camera: Camera, pixel: Points2) -> Mask:
    """(n,) whether each pixel position (n, 2) lies in the image."""
    size_px = np.array([camera.width_px, camera.height_px])
    return np.asarray(((pixel >= -0.5) & (pixel <= size_px - 0.5)).all(axis=1))


def into_image(camera: Camera, pixel: Points2) -> Points2:
    """The positions (n, 2) of the image that are nearest to the given ones."""
    size_px = np.array([camera.width_px, camera.height_px])
    return np.asarray(np.minimum(np.maximum(pixel, -0.5), size_px - 0.5))


def undistorted(camera: Camera, pixel: Points2) -> Points2:
    """Pixels of a camera with the same matrix but without distortion."""
    focal_px = np.array([camera.fx_px, camera.fy_px])
    straight: Points2 = ray(camera, pixel) * focal_px + np.array([camera.cx_px, camera.cy_px])
    return straight


def mm_per_px(camera: Camera) -> float:
    """Size of a pixel at the sheet's origin, geometric mean of x and y."""
    distance_mm = float(camera.translation_mm[2])
    return distance_mm / float(np.sqrt(camera.fx_px * camera.fy_px))
