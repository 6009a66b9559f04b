"""The paper's chain as its text describes it: OpenCV for the image, plain Python loops for the markers.

Section 3.3 and equations 11 to 13: undistort, threshold (Otsu), opening with padding, contours, midpoints,
sorted, the gate, perimeters of the quads of four diagonal neighbours. `--method paper` does it faster.
"""

import cv2
import numpy as np
from rounds import Answer, Footage

from manytouch.geometry.camera import camera_matrix, undistorted

GATE_PITCHES = 0.4
KERNEL_PX = 3


class PlainChain:
    """The chain and its list of identities; the first frame's are given."""

    def __init__(self, footage: Footage) -> None:
        course = footage.course
        sensor = course.sensor
        self.frames = footage.frames
        self.matrix, self.distortion = camera_matrix(sensor.camera), sensor.camera.distortion
        self.distance_mm = float(sensor.camera.translation_mm[2])
        self.gate_px = GATE_PITCHES * course.pitch_px
        self.least_px2 = 0.25 * np.pi * course.radius_px**2
        self.rows, self.columns = sensor.layout.shape
        self.listed = [tuple(each) for each in undistorted(sensor.camera, course.centre_px[0]).tolist()]
        self.first = [self._perimeter(self.listed, number) for number in range(len(self.listed))]

    def __call__(self, index: int) -> tuple[Answer, list[float]]:
        """Identities, and the depth of every marker."""
        points = self._midpoints(self.frames[index].image)
        marker = []
        for x, y in points:
            found = -1
            for number, (old_x, old_y) in enumerate(self.listed):
                if ((x - old_x) ** 2 + (y - old_y) ** 2) ** 0.5 < self.gate_px:
                    found = number
                    break
            marker.append(found)
        for found, point in zip(marker, points, strict=True):
            if found >= 0:
                self.listed[found] = point
        depth_mm = []
        for number, first in enumerate(self.first):
            now = self._perimeter(self.listed, number)
            depth_mm.append(self.distance_mm * (1.0 - first / now))
        return Answer(centre_px=self._in_camera(np.array(points)), marker=np.array(marker)), depth_mm

    def _midpoints(self, image: np.ndarray) -> list[tuple[float, float]]:
        straight = cv2.undistort(image, self.matrix, self.distortion)
        _, binary = cv2.threshold(straight, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
        padded = cv2.copyMakeBorder(binary, *(4 * [KERNEL_PX]), cv2.BORDER_REPLICATE)
        opened = cv2.morphologyEx(padded, cv2.MORPH_OPEN, np.ones((KERNEL_PX, KERNEL_PX), np.uint8))
        opened = opened[KERNEL_PX:-KERNEL_PX, KERNEL_PX:-KERNEL_PX]
        contours, _ = cv2.findContours(opened, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        points = []
        for contour in contours:
            moments = cv2.moments(contour)
            if moments["m00"] > self.least_px2:
                points.append((moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]))
        return sorted(points, key=lambda point: (round(point[1] / self.gate_px), point[0]))

    def _perimeter(self, points: list[tuple[float, float]], number: int) -> float:
        """The quad's perimeter around a marker; at the edge that of its nearest inner neighbour."""
        row = min(max(number // self.columns, 1), self.rows - 2)
        column = min(max(number % self.columns, 1), self.columns - 2)
        (x4, y4), (x3, y3), (x2, y2), (x1, y1) = (
            points[(row + down) * self.columns + column + right]
            for down, right in ((-1, -1), (-1, 1), (1, 1), (1, -1))
        )
        return (y1 - y4) + (x2 - x1) + (y2 - y3) + (x3 - x4)

    def _in_camera(self, straight_px: np.ndarray) -> np.ndarray:
        """Midpoints of the undistorted picture where the camera showed them."""
        ray = np.column_stack([straight_px, np.ones(len(straight_px))]) @ np.linalg.inv(self.matrix).T
        bent, _ = cv2.projectPoints(ray, np.zeros(3), np.zeros(3), self.matrix, self.distortion)
        return bent[:, 0]
