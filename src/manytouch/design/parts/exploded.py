"""An exploded picture of the assembly: printed parts, camera, light and screws above each other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from manytouch.design.parts.casing import (
    SCREW_RADIUS_MM,
    CasingChoices,
    Part,
    height_mm,
    ledge_mm,
    screw_places,
)
from manytouch.design.parts.meshing import PartMesh, make_mesh
from manytouch.design.parts.pictures import places_px, render_meshes
from manytouch.design.parts.solids import Solid, block, pins
from manytouch.errors import MissingExtraError
from manytouch.values import Sensor

RISE_DEG, ACROSS_PX = 24.0, 700
GAP_SHARE = 0.28
"""Gap between two layers over the length of the sheet's longer side."""
BOARD_MARGIN_MM, BOARD_MM = 4.0, 1.6
STRIP_MM, HEAD_RADIUS_MM, HEAD_MM = 2.0, 2.75, 3.0
YELLOW, GREEN, STEEL, GLASS = "#f0c93c", "#2f8f5b", "#c3c7cd", "#39424e"
CASING, CLAMP = "#7c8796", "#a3adba"  # lighter than they are printed, which distinguishes them from the sheet


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ExplodedLayer:
    """What is drawn at one height, from below to above.

    Attributes:
        label: next to it.
        corners_mm: (t, 3, 3) triangles of each mesh, the lowest point at z = 0.
        colours: of each mesh.
    """

    label: str
    corners_mm: tuple[Float64[np.ndarray, "_ 3 3"], ...]
    colours: tuple[str, ...]


def draw_exploded(
    sensor: Sensor,
    parts: Sequence[Part],
    meshes: Mapping[str, PartMesh],
    choices: CasingChoices,
    path: Path,
    *,
    screw_mm: int,
) -> None:
    """Draws the assembly as a PNG with a label for each layer.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError("pictures of parts", "matplotlib", "parts") from None
    layers = assembly_layers(sensor, parts, meshes, choices, screw_mm=screw_mm)
    assert sensor.sheet is not None
    gap_mm = GAP_SHARE * float(np.max(sensor.sheet.size_mm))
    shown: list[np.ndarray] = []
    points: list[np.ndarray] = []
    z_mm = 0.0
    for layer in layers:
        raised = [np.asarray(part + np.array([0.0, 0.0, z_mm])) for part in layer.corners_mm]
        shown += raised
        points.append(np.concatenate([part.reshape(-1, 3) for part in raised]))
        z_mm = float(points[-1][:, 2].max()) + gap_mm
    image = render_meshes(
        shown, [one for layer in layers for one in layer.colours], rise_deg=RISE_DEG, across_px=ACROSS_PX
    )
    outlines_px = [places_px(shown, point_mm, rise_deg=RISE_DEG, across_px=ACROSS_PX) for point_mm in points]
    at_px = [outline[np.argmax(outline[:, 0])].tolist() for outline in outlines_px]
    height, width = image.shape[:2]
    figure = Figure(figsize=(10.0, min(12.0, 6.2 * height / width + 0.2)), layout="constrained")
    axes = figure.subplots()
    axes.imshow(image, interpolation="antialiased")
    for layer, (column, row) in zip(layers, at_px, strict=True):
        axes.annotate(
            layer.label,
            (column, row),
            xytext=(1.06 * width, row),
            va="center",
            fontsize=10,
            arrowprops={"arrowstyle": "-", "color": "0.5", "linewidth": 0.8},
        )
    axes.set(xlim=(0, 1.62 * width), ylim=(height, 0))
    axes.set_axis_off()
    figure.savefig(path, dpi=110)


def assembly_layers(
    sensor: Sensor,
    parts: Sequence[Part],
    meshes: Mapping[str, PartMesh],
    choices: CasingChoices,
    *,
    screw_mm: int,
) -> tuple[ExplodedLayer, ...]:
    """The layers of the assembly, from below to above; the camera looks up."""
    corner_mm = {part.name: meshes[part.name].corners_mm for part in parts}
    sheet_colour = next(part.colour for part in parts if part.name == "sheet")
    places = screw_places(sensor, choices)
    holes = np.array(choices.board_holes_mm)
    board = block(
        (float(holes[0]) + 2 * BOARD_MARGIN_MM, float(holes[1]) + 2 * BOARD_MARGIN_MM), (0.0, BOARD_MM)
    )
    lens = pins(np.zeros((1, 2)), choices.lens_radius_mm - 1.0, (BOARD_MM, choices.board_depth_mm))
    width_mm = ledge_mm(sensor, choices)
    assert sensor.sheet is not None
    x, y = (float(side) for side in sensor.sheet.size_mm)
    strip = Solid(
        joined=(block((x, y), (0.0, STRIP_MM)),),
        removed=(block((x - 2 * width_mm, y - 2 * width_mm), (-1.0, STRIP_MM + 1.0)),),
    )
    screws = Solid(
        joined=(
            pins(places, SCREW_RADIUS_MM, (0.0, float(screw_mm))),
            pins(places, HEAD_RADIUS_MM, (float(screw_mm), screw_mm + HEAD_MM)),
        )
    )
    distance_mm = float(sensor.camera.translation_mm[2])
    return (
        ExplodedLayer(
            label="camera with lens, screwed\nunder the plate of the casing",
            corners_mm=(_corners(Solid(joined=(board,))), _corners(Solid(joined=(lens,)))),
            colours=(GREEN, GLASS),
        ),
        ExplodedLayer(
            label=f"casing, {height_mm(sensor, choices):.1f} mm high: the centre of the\n"
            f"lens is then {distance_mm:.1f} mm below the sheet",
            corners_mm=(corner_mm["casing"],),
            colours=(CASING,),
        ),
        ExplodedLayer(
            label="LED strip with white paper,\non the ledge in the casing",
            corners_mm=(_corners(strip),),
            colours=(YELLOW,),
        ),
        ExplodedLayer(
            label="sheet, markers down\n(towards the camera)",
            corners_mm=(_turned_over(corner_mm["sheet"]),),
            colours=(sheet_colour,),
        ),
        ExplodedLayer(label="clamp", corners_mm=(corner_mm["clamp"],), colours=(CLAMP,)),
        ExplodedLayer(
            label=f"{len(places)} screws M3 x {screw_mm}, nuts\nin the flange of the casing",
            corners_mm=(_corners(screws),),
            colours=(STEEL,),
        ),
    )


def _corners(solid: Solid) -> Float64[np.ndarray, "_ 3 3"]:
    return make_mesh(solid).corners_mm


def _turned_over(corners_mm: Float64[np.ndarray, "_ 3 3"]) -> Float64[np.ndarray, "_ 3 3"]:
    """A part turned by half a turn about x, which is how the sheet is mounted, on z = 0."""
    turned = corners_mm * [1.0, -1.0, -1.0]
    return np.asarray(turned - [0.0, 0.0, turned[..., 2].min()])
