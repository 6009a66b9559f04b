"""A solved sheet in brief: how its camera-side face has moved, and what touched it.

The face's displacements stand on a grid: corners, edge middles and middles of its elements, x by y.
Between them run the quadratic polynomials of the finite elements, so against the solver's own shape
functions nothing is lost but rounding. (A serendipity element has no middle node; with half the sum of
the edge middles less a quarter of the sum of the corners there, the nine-node element is the same.)
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Points2, Points3, read_only, read_only_view

ROW_BEFORE_REGIONS = 8
"""Numbers of a contact in files without regions."""

FaceGrid = Float32[np.ndarray, "a b 3"]
"""A displacement at each point of the grid of a face, along x and y."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrueContact:
    """What one indenter or patch does to the sheet; NaN, with no force, where it does not touch.

    Attributes:
        force_N: (3,) on the sheet; a press has z < 0, the normal force is -z.
        torque_Nmm: about z at the force centroid.
        area_mm2: of the touched face in contact, on undeformed coordinates.
        centre_mm: (2,) centroid of the normal force over undeformed coordinates.
        depth_mm: largest depth of the camera-side face within that area, of a pad of its contact face.
        region_mm2: area of its region (see `values.Contact.area_mm2`); NaN where it was not read out.
        moment_mm2: (3,) second moments xx, yy, xy of the normal force about the centroid, on undeformed
            coordinates; NaN likewise.
    """

    force_N: Float64[np.ndarray, "3"]
    torque_Nmm: float
    area_mm2: float
    centre_mm: Float64[np.ndarray, "2"]
    depth_mm: float
    region_mm2: float = np.nan
    moment_mm2: tuple[float, float, float] = (np.nan, np.nan, np.nan)

    @property
    def is_touching(self) -> bool:
        """Whether any force is passed on."""
        return bool(self.force_N[2] != 0.0)

    @property
    def normal_force_N(self) -> float:
        """Positive in compression."""
        return -float(self.force_N[2])

    @property
    def ellipse(self) -> tuple[float, float, float]:
        """Half axes in mm and angle of the major one, rad, of the uniform ellipse with its moments."""
        xx, yy, xy = self.moment_mm2
        mean, apart = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
        angle_rad = 0.5 * math.atan2(2.0 * xy, xx - yy)
        return 2.0 * math.sqrt(mean + apart), 2.0 * math.sqrt(max(mean - apart, 0.0)), angle_rad


NO_CONTACT = TrueContact(
    force_N=read_only(np.zeros(3)),
    torque_Nmm=np.nan,
    area_mm2=0.0,
    centre_mm=read_only(np.full(2, np.nan)),
    depth_mm=np.nan,
)
"""The contact of a body that does not touch the sheet."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deformation:
    """The camera-side face of a pressed sheet, and its true contacts; of a pad the plane of its markers.

    Attributes:
        x_mm, y_mm: (a,), (b,) lines of the grid, every second one between two elements.
        face_mm: (a, b, 3) displacement there, sheet frame: a press has z < 0.
        contact_face_mm: (a, b, 3) the same of the contact face of a pad; None: a clamped sheet.
        contacts: one for each touch, then one for each patch of the loading, in its order.
        status: of the solver, "ok" or "not_converged".
    """

    x_mm: Float64[np.ndarray, " a"]
    y_mm: Float64[np.ndarray, " b"]
    face_mm: FaceGrid
    contacts: tuple[TrueContact, ...]
    status: str
    contact_face_mm: FaceGrid | None = None

    @property
    def touched(self) -> "Deformation":
        """The contact face of a pad as a deformation of its own, with the same contacts.

        Of a clamped sheet this deformation itself: its depths are those of the camera-side face.
        """
        if self.contact_face_mm is None:
            return self
        return replace(self, face_mm=self.contact_face_mm, contact_face_mm=None)

    def displacement_mm(self, place_mm: Points2) -> Points3:
        """Displacement (m, 3) of undeformed places (m, 2); NaN outside the sheet."""
        return self._sampled(place_mm, np.empty((0, 3, 2)))

    def camera_side(self, place_mm: Points2) -> tuple[Points3, Float64[np.ndarray, "m 3 2"]]:
        """Displacement (m, 3) and dx/dX in the plane (m, 3, 2), the first columns of F; NaN outside.

        The gradient jumps a little from element to element.
        """
        gradient = np.empty((len(place_mm), 3, 2))
        return self._sampled(place_mm, gradient), gradient

    def moved_mm(self, place_mm: Points2, height_mm: float) -> Points3:
        """Displacement (m, 3) of points that stand height_mm off the face, on its normal."""
        if height_mm == 0.0:
            return self.displacement_mm(place_mm)
        moved_mm, normal = self.normals(place_mm)
        return np.asarray(moved_mm + height_mm * ([0.0, 0.0, 1.0] - normal))

    def normals(self, place_mm: Points2) -> tuple[Points3, Points3]:
        """Displacements (m, 3) and unit normals (m, 3) of the face, away from the camera."""
        moved_mm, gradient = self.camera_side(place_mm)
        normal = np.cross(gradient[:, :, 0], gradient[:, :, 1])
        return moved_mm, normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def _sampled(self, place_mm: Points2, gradient: np.ndarray) -> Points3:
        found_mm = np.empty((len(place_mm), 3))
        place_mm = read_only_view(np.ascontiguousarray(place_mm))
        _sample(self.x_mm, self.y_mm, self.face_mm, place_mm, found_mm, gradient)
        return found_mm


def undeformed(like: Deformation) -> Deformation:
    """The same sheet with nothing on it."""
    still_mm = read_only(np.zeros_like(like.face_mm))
    contact_face_mm = None if like.contact_face_mm is None else still_mm
    return replace(like, face_mm=still_mm, contact_face_mm=contact_face_mm, contacts=(), status="ok")


def flat(size_mm: tuple[float, float]) -> Deformation:
    """A sheet of that outline with nothing on it."""
    x_mm, y_mm = (read_only(np.array([-0.5, 0.0, 0.5]) * size) for size in size_mm)
    face_mm = read_only(np.zeros((3, 3, 3), dtype=np.float32))
    return Deformation(x_mm=x_mm, y_mm=y_mm, face_mm=face_mm, contacts=(), status="ok")


def contact_from_row(row: np.ndarray) -> TrueContact:
    """A contact from force, torque, area, centre and depth, and in longer rows region and moments."""
    more = [float(number) for number in row[ROW_BEFORE_REGIONS:]] or [np.nan] * 4
    return TrueContact(
        force_N=read_only(row[:3].copy()),
        torque_Nmm=float(row[3]),
        area_mm2=float(row[4]),
        centre_mm=read_only(row[5:7].copy()),
        depth_mm=float(row[7]),
        region_mm2=more[0],
        moment_mm2=(more[1], more[2], more[3]),
    )


def row_from_contact(contact: TrueContact) -> list[float]:
    """The row of `contact_from_row`."""
    first = [*contact.force_N, contact.torque_Nmm, contact.area_mm2, *contact.centre_mm, contact.depth_mm]
    return [*first, contact.region_mm2, *contact.moment_mm2]


def fill_middles(face_mm: np.ndarray) -> None:
    """Set the middles of the elements of grids (..., a, b, 3) to what serendipity elements have there."""
    edges = face_mm[..., 1::2, :-2:2, :] + face_mm[..., 1::2, 2::2, :]
    edges += face_mm[..., :-2:2, 1::2, :] + face_mm[..., 2::2, 1::2, :]
    corners = face_mm[..., ::2, ::2, :]
    corner_sum = corners[..., :-1, :-1, :] + corners[..., 1:, :-1, :]
    corner_sum += corners[..., :-1, 1:, :] + corners[..., 1:, 1:, :]
    face_mm[..., 1::2, 1::2, :] = 0.5 * edges - 0.25 * corner_sum


@kernel()
@no_type_check
def _cell(lines: np.ndarray, place: float, value: np.ndarray, slope: np.ndarray) -> int:
    """First of the three lines around a place, and the quadratics through them; -1 outside."""
    last = lines.shape[0] - 1
    margin = 1e-9 * (lines[last] - lines[0])
    if not (lines[0] - margin <= place <= lines[last] + margin):
        return -1
    low, high = 0, last // 2
    while high - low > 1:
        middle = (low + high) // 2
        if place >= lines[2 * middle]:
            low = middle
        else:
            high = middle
    width = lines[2 * low + 2] - lines[2 * low]
    t = (place - lines[2 * low]) / width
    value[0], value[1], value[2] = (1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)
    slope[0], slope[1], slope[2] = (4 * t - 3) / width, (4 - 8 * t) / width, (4 * t - 1) / width
    return 2 * low


@kernel()
@no_type_check
def _sample(  # noqa: PLR0917 - compiled
    x: np.ndarray, y: np.ndarray, face: np.ndarray, place: np.ndarray, found: np.ndarray, gradient: np.ndarray
) -> None:
    """Fill found (m, 3), and gradient (m, 3, 2) where it has room."""
    wants_gradient = gradient.shape[0] > 0
    along_x, steep_x, along_y, steep_y = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for m in range(place.shape[0]):
        first = _cell(x, place[m, 0], along_x, steep_x)
        second = _cell(y, place[m, 1], along_y, steep_y)
        for k in range(3):
            moved, change_x, change_y = 0.0, 0.0, 0.0
            if first < 0 or second < 0:
                moved = np.nan
            else:
                for i in range(3):
                    for j in range(3):
                        here = face[first + i, second + j, k]
                        moved += along_x[i] * along_y[j] * here
                        change_x += steep_x[i] * along_y[j] * here
                        change_y += along_x[i] * steep_y[j] * here
            found[m, k] = moved
            if wants_gradient:
                gradient[m, k, 0] = moved * 0.0 + change_x + (1.0 if k == 0 else 0.0)
                gradient[m, k, 1] = moved * 0.0 + change_y + (1.0 if k == 1 else 0.0)
