"""Many deformations of one sheet in a small file, each under a key.

An `.npz` with the lines of the grid, keys, states and contacts in plain arrays, and the faces in `faces`:
displacements in whole steps of `step_mm`, edge middles less the mean of their two corners, each array
less the one before it in the file, then differences along x and y, low bytes before high ones, LZMA.
The middles of the elements follow from the rest. Only the first rounding loses anything. The contact face
of a pad follows the plane of its markers, under the same key with FACE behind it.
"""

import io
import lzma
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources.abc import Traversable
from pathlib import Path

import numpy as np

from manytouch.errors import OutputError, SourceError
from manytouch.simulation.scene.deformation import (
    Deformation,
    contact_from_row,
    fill_middles,
    row_from_contact,
)
from manytouch.values.arrays import read_only

STEP_MM = 2e-4
"""Displacements on the grid are kept to within half of this; 0.0002 mm is 0.004 px of the demo sensor."""
FORMAT = 1
FACE = " face"


def write_deformations(
    path: Path, deformations: Mapping[str, Deformation], *, step_mm: float = STEP_MM
) -> int:
    """Keep deformations of one mesh under their keys, in this order; the size of the file in bytes.

    Neighbours in the order should resemble each other: only what changes takes room.

    Raises:
        ValueError: there are none, or their grids or numbers of contacts differ.
        OutputError: the file cannot be written.
    """
    planes = _planes(deformations)
    states = list(planes.values())
    if len({(state.x_mm.tobytes(), state.y_mm.tobytes(), len(state.contacts)) for state in states}) != 1:
        raise ValueError("a file of deformations contains one sheet, one mesh and one number of contacts")
    whole = np.rint(np.stack([state.face_mm for state in states]) / step_mm).astype(np.int64)
    packed = io.BytesIO()
    np.savez(
        packed,
        format=np.array(FORMAT),
        step_mm=np.array(step_mm),
        x_mm=states[0].x_mm,
        y_mm=states[0].y_mm,
        keys=np.array(list(planes)),
        status=np.array([state.status for state in states]),
        contacts=np.array([[row_from_contact(contact) for contact in state.contacts] for state in states]),
        faces=np.frombuffer(_squeezed(whole), dtype=np.uint8),
    )
    aside = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        aside.write_bytes(packed.getvalue())
        aside.replace(path)
    except OSError as error:
        raise OutputError(f"cannot write deformations to {path}: {error.strerror}") from None
    return len(packed.getvalue())


def read_deformations(path: Path | Traversable) -> dict[str, Deformation]:
    """The deformations of a file, in its order; also of one inside the package (`importlib.resources`).

    Raises:
        SourceError: the file is missing, damaged, or from another version.
    """
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            table = {name: file[name] for name in file.files}
        if int(table["format"]) != FORMAT:
            raise SourceError(f"{path} is a file of deformations of another version of manytouch")
        keys = [str(key) for key in table["keys"]]
        shape = (len(keys), len(table["x_mm"]), len(table["y_mm"]), 3)
        whole = _spread(table["faces"].tobytes(), shape).astype(np.float64)
    except OSError as error:
        raise SourceError(f"cannot read deformations from {path}: {error.strerror}") from None
    except (zipfile.BadZipFile, lzma.LZMAError, EOFError, KeyError, ValueError):
        raise SourceError(f"{path} is not a file of deformations, or it is damaged") from None
    fill_middles(whole)
    faces_mm = read_only((whole * float(table["step_mm"])).astype(np.float32))
    x_mm, y_mm = read_only(table["x_mm"]), read_only(table["y_mm"])
    planes = {
        key: Deformation(
            x_mm=x_mm,
            y_mm=y_mm,
            face_mm=face_mm,
            contacts=tuple(contact_from_row(row) for row in (rows if rows.ndim == 2 else ())),
            status=str(status),
        )
        for key, face_mm, rows, status in zip(keys, faces_mm, table["contacts"], table["status"], strict=True)
    }
    faces = {key: planes.pop(key) for key in keys if key.endswith(FACE)}
    return {
        key: replace(plane, contact_face_mm=faces[key + FACE].face_mm) if key + FACE in faces else plane
        for key, plane in planes.items()
    }


def _planes(deformations: Mapping[str, Deformation]) -> dict[str, Deformation]:
    """Each deformation, and behind that of a pad its contact face."""
    planes = {}
    for key, state in deformations.items():
        planes[key] = state
        if state.contact_face_mm is not None:
            planes[key + FACE] = state.touched
    return planes


def _parts(whole: np.ndarray) -> list[np.ndarray]:
    """Views (k, i, j, 3) of the corners and of the middles of edges along x and along y."""
    return [whole[:, ::2, ::2], whole[:, 1::2, ::2], whole[:, ::2, 1::2]]


def _expected(corners: np.ndarray, part: int) -> np.ndarray:
    """Whole numbers that a part is kept relative to."""
    if part == 0:
        return np.zeros_like(corners)
    both = corners[:, :-1] + corners[:, 1:] if part == 1 else corners[:, :, :-1] + corners[:, :, 1:]
    return np.asarray(both >> 1)


def _squeezed(whole: np.ndarray) -> bytes:
    planes = []
    for part, numbers in enumerate(_parts(whole)):
        change = numbers - _expected(whole[:, ::2, ::2], part)
        for axis in range(3):
            change = np.diff(change, axis=axis, prepend=0)
        folded = np.where(change < 0, -2 * change - 1, 2 * change).astype("<u4")  # small whichever sign
        planes.append(np.moveaxis(folded, -1, 0).reshape(-1, 1).view(np.uint8).T)
    return lzma.compress(np.concatenate(planes, axis=1).tobytes(), preset=9 | lzma.PRESET_EXTREME)


def _spread(squeezed: bytes, shape: tuple[int, int, int, int]) -> np.ndarray:
    whole = np.zeros(shape, dtype=np.int64)
    parts = _parts(whole)
    plane = np.frombuffer(lzma.decompress(squeezed), dtype=np.uint8).reshape(4, -1)
    begin = 0
    for part, numbers in enumerate(parts):
        kept = np.ascontiguousarray(plane[:, begin : begin + numbers.size].T).view("<u4").astype(np.int64)
        begin += numbers.size
        change = np.where(kept % 2 == 1, -(kept + 1) // 2, kept // 2)
        change = np.moveaxis(change.reshape(3, *numbers.shape[:3]), 0, -1)
        for axis in range(3):
            change = np.cumsum(change, axis=axis)
        numbers[...] = change + _expected(whole[:, ::2, ::2], part)
    return whole
