"""The scene file: TOML, checked key by key like the sensor file, every mistake named at once."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError, ValidationInfo, field_validator

from manytouch.errors import SensorError, SourceError
from manytouch.limits import (
    MAX_MARKERS,
    MAX_SCENE_BODIES,
    MAX_SCENE_ELEMENTS,
    MAX_SCENE_FRAMES,
    size_mistake,
)
from manytouch.simulation.demo_sensor import BUILT_IN_SENSORS, DESIGNED_WIDTHS_PX
from manytouch.simulation.render.discs import DARK_DOTS, LIGHT_DOTS, Look, Spot
from manytouch.simulation.render.optics import Faults, ImagingSettings, draw_faults
from manytouch.simulation.scene.bodies import BodySection, Pair
from manytouch.simulation.scene.motion import Body
from manytouch.simulation.scene.pad import CONTACT_ELEMENT_MM, ELEMENT_MM, LAYERS
from manytouch.values import Layout, Sensor, Sheet
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.sections import Count, NonNegative, Number, Positive, Section, all_mistakes
from manytouch.values.sensor_file.toml_file import read_toml

BUILT_IN = files("manytouch.simulation") / "scenes"
Share = Annotated[float, Field(ge=0, le=1)]
Level = Annotated[float, Field(ge=0, le=255)]
Levels = Annotated[list[Level], Field(min_length=3, max_length=3)]
Some = Annotated[int, Field(ge=0, le=MAX_MARKERS)]
Grey = Annotated[float, Field(ge=0, le=1e4)]
MIN_WIDTH_PX, MAX_SPOTS = 64, 100


class _Spot(Section):
    centre_px: Pair
    radius_px: Positive
    amount: Positive

    def spot(self) -> Spot:
        x, y = self.centre_px
        return Spot(centre_px=(x, y), radius_px=self.radius_px, amount=self.amount)


class _Light(Section):
    ground: Level | Levels | None = None
    dot: Level | Levels | None = None
    tilt_x: Number = 0.0
    tilt_y: Number = 0.0
    vignetting: Share = 0.0
    glare: list[_Spot] = Field(default_factory=list, max_length=MAX_SPOTS)
    shadows: list[_Spot] = Field(default_factory=list, max_length=MAX_SPOTS)
    read_noise: Grey = 0.0
    shot_noise: Grey = 0.0
    flicker: Share = 0.0
    flicker_Hz: NonNegative = 0.0


class _Lens(Section):
    blur_px: Annotated[float, Field(gt=0, le=100)] = 0.8
    aperture_mm: NonNegative = 0.0
    focus_mm: Positive | None = None
    exposure_s: NonNegative = 0.0
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] | None = None


class _Faults(Section):
    missing: Some = 0
    half_printed: Some = 0
    dust: Some = 0
    body_shadow: Share = 0.0


class _Solid(Section):
    element_mm: Positive | None = None
    contact_element_mm: Positive | None = None
    layers: Annotated[int, Field(gt=0, le=16)] | None = None
    step_mm: Positive | None = None

    def settings(self, sheet: Sheet) -> "MeshSettings":
        """With the defaults for a clamped sheet or a bonded pad where nothing is stated."""
        is_pad = sheet.boundary == "bonded"
        if self.contact_element_mm is not None and not is_pad:
            raise SourceError(
                "contact_element_mm of [solid] is for bonded pads: remove it, or choose element_mm"
            )
        usual = PAD_MESH if is_pad else SHEET_MESH
        return replace(usual, **self.model_dump(exclude_none=True))


class _File(Section):
    schema_version: Annotated[int, Field(alias="schema", ge=1, le=1, examples=[1])]
    name: str = Field(default="scene", pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.-]*$")
    seconds: Positive
    fps: Positive = Field(default=30.0, validate_default=True)
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 0
    sensor: str = Field(default="demo", min_length=1)
    width_px: Count | None = None
    mechanics: Literal["solid", "shell"] = "solid"
    solid: _Solid = Field(default_factory=_Solid)
    light: _Light = Field(default_factory=_Light)
    lens: _Lens = Field(default_factory=_Lens)
    faults: _Faults = Field(default_factory=_Faults)
    bodies: list[BodySection] = Field(default_factory=list, max_length=MAX_SCENE_BODIES)

    @field_validator("fps")
    @classmethod
    def _has_frames_for_a_recording(cls, fps: float, info: ValidationInfo) -> float:
        seconds = info.data.get("seconds", 0.0)
        if seconds * fps > MAX_SCENE_FRAMES:
            raise ValueError(
                f"{seconds:g} s at {fps:g} frames per second are too many frames: at most "
                f"{MAX_SCENE_FRAMES} are allowed"
            )
        return fps

    @field_validator("width_px")
    @classmethod
    def _is_a_size(cls, width_px: int | None) -> int | None:
        if width_px is not None:
            mistake = size_mistake(width_px, round(width_px * 9 / 16))
            if mistake is not None or width_px < MIN_WIDTH_PX:
                raise ValueError(mistake or f"at least {MIN_WIDTH_PX} px are needed")
        return width_px


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MeshSettings:
    """How finely the sheet is solved.

    Attributes:
        element_mm: largest width of the elements.
        layers: of elements through the thickness, of a pad the least number.
        step_mm: furthest way of a body from one equilibrium to the next.
        contact_element_mm: of a pad, largest width of the elements that a body touches.
    """

    element_mm: float
    layers: int
    step_mm: float
    contact_element_mm: float


SHEET_MESH = MeshSettings(element_mm=2.0, layers=1, step_mm=1.25, contact_element_mm=math.inf)
PAD_MESH = MeshSettings(
    element_mm=ELEMENT_MM, layers=LAYERS, step_mm=0.25, contact_element_mm=CONTACT_ELEMENT_MM
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SceneFile:
    """The content of a scene file.

    Attributes:
        name, duration_s, fps, seed: of the recording; the seed is of noise and faults.
        sensor: that is pressed; layout and sheet are there, the sheet's material is known.
        mechanics: "solid", 3-D finite elements, or "shell", the sheet that is solved live.
        mesh: of the solid.
        bodies: that press.
        look, optics, faults: of the pictures.
    """

    name: str
    duration_s: float
    fps: float
    seed: int
    sensor: Sensor
    mechanics: Literal["solid", "shell"]
    mesh: MeshSettings
    bodies: tuple[Body, ...]
    look: Look
    optics: ImagingSettings
    faults: Faults

    @property
    def layout(self) -> Layout:
        """Layout of the sensor."""
        assert self.sensor.layout is not None
        return self.sensor.layout

    @property
    def sheet(self) -> Sheet:
        """Sheet of the sensor."""
        assert self.sensor.sheet is not None
        return self.sensor.sheet


def built_in_scenes() -> tuple[str, ...]:
    """Names of the scenes in the package."""
    return tuple(
        sorted(path.name.removesuffix(".toml") for path in BUILT_IN.iterdir() if path.name.endswith(".toml"))
    )


def scene_path(text: str) -> Path:
    """The file of a scene: a path, or `sim:NAME` of a built-in scene.

    Raises:
        SourceError: there is no built-in scene of that name.
    """
    if not text.startswith("sim:"):
        return Path(text).expanduser()
    name = text.removeprefix("sim:") or "fingers"
    if name.endswith(".toml"):
        return Path(name).expanduser()
    if name not in built_in_scenes():
        raise SourceError(
            f"there is no built-in scene {text!r}: use {', '.join(built_in_scenes())}, as in sim:pad"
        )
    return Path(str(BUILT_IN / f"{name}.toml"))


def load_scene(path: str | Path | Traversable, *, width_px: int | None = None) -> SceneFile:
    """Read a scene file; paths in it start at its folder.

    Args:
        path: the file.
        width_px: of the pictures of a built-in sensor, instead of the file's.

    Raises:
        SourceError: the file is missing, is not TOML, or has unknown keys, wrong types or impossible
            values; the message lists all of them. Or its meshes cannot be read.
        SensorError: its sensor file is wrong or incomplete.
    """
    path = Path(path) if isinstance(path, str) else path
    try:
        table = read_toml(path, "a scene file", SourceError)
    except FileNotFoundError:
        own = f"; sim:{path} is a built-in scene" if str(path) in built_in_scenes() else ""
        raise SourceError(
            f"no scene file was found at {path}: give the path of an existing .toml{own}"
        ) from None
    try:
        checked = _File.model_validate(table)
    except ValidationError as error:
        raise SourceError(all_mistakes(f"scene file {path}", error, _File)) from None
    folder = path.parent if isinstance(path, Path) else Path()
    return _scene(checked, folder, width_px or checked.width_px)


def _scene(file: _File, folder: Path, width_px: int | None) -> SceneFile:
    sensor = _sensor(file.sensor, folder, width_px)
    if sensor.layout is None or sensor.sheet is None:
        raise SensorError(f"the sensor {sensor.name!r} of a scene needs [sheet] and [markers]")
    if sensor.sheet.young_MPa is None or sensor.sheet.poisson is None:
        raise SensorError(
            f"the sheet of the sensor {sensor.name!r} needs young_MPa and poisson to be pressed"
        )
    if file.mechanics == "shell" and sensor.sheet.boundary == "bonded":
        raise SourceError(
            f'mechanics = "shell" is for clamped sheets, but that of {sensor.name!r} is bonded: use "solid"'
        )
    _require_depths(file.bodies, sensor.sheet)
    mesh = file.solid.settings(sensor.sheet)
    element_mm = min(mesh.element_mm, mesh.contact_element_mm)
    elements = mesh.layers * float((sensor.sheet.size_mm / element_mm + 1.0).prod())
    if elements > MAX_SCENE_ELEMENTS:
        raise SourceError(
            f"a sheet of elements of {element_mm:g} mm has {elements:.3g} of them: at most "
            f"{MAX_SCENE_ELEMENTS} are allowed, choose a larger element_mm"
        )
    faults, count = file.faults, int((~sensor.layout.is_missing).sum())
    if faults.missing + faults.half_printed > count:
        raise SourceError(
            f"{faults.missing} missing and {faults.half_printed} half-printed dots are more than the {count} "
            f"dots of the sensor {sensor.name!r}"
        )
    return SceneFile(
        name=file.name,
        duration_s=file.seconds,
        fps=file.fps,
        seed=file.seed,
        sensor=sensor,
        mechanics=file.mechanics,
        mesh=mesh,
        bodies=tuple(body for section in file.bodies for body in section.bodies(folder)),
        look=_look(file.light, sensor.layout.polarity),
        optics=ImagingSettings(
            **file.lens.model_dump(), flicker=file.light.flicker, flicker_Hz=file.light.flicker_Hz
        ),
        faults=draw_faults(
            sensor.layout,
            sensor.sheet,
            missing=faults.missing,
            half_printed=faults.half_printed,
            dust=faults.dust,
            shadow=faults.body_shadow,
            seed=file.seed,
        ),
    )


def _require_depths(bodies: Sequence[BodySection], sheet: Sheet) -> None:
    if sheet.boundary == "bonded":
        limit_mm, limit = sheet.thickness_mm, "the thickness of this pad"
    else:
        limit_mm, limit = float(np.min(sheet.size_mm)) / 2.0, "half of the shorter side of this sheet"
    wrong = [
        f"bodies.{number}.{key}: a depth of {depth_mm:g} mm"
        for number, body in enumerate(bodies)
        for key, depth_mm in body.depths_mm()
        if depth_mm > limit_mm
    ]
    if wrong:
        more = f"; and {len(wrong) - 1} more" if len(wrong) > 1 else ""
        raise SourceError(f"{wrong[0]} is not computed: choose at most {limit_mm:g} mm, {limit}{more}")


def _sensor(text: str, folder: Path, width_px: int | None) -> Sensor:
    if text in BUILT_IN_SENSORS:
        return BUILT_IN_SENSORS[text](width_px or DESIGNED_WIDTHS_PX[text])
    sensor = load_sensor(folder / text)
    if width_px not in {None, sensor.camera.width_px}:
        raise SensorError(
            f"width_px = {width_px} is for the built-in sensors; the camera of {text} has "
            f"{sensor.camera.width_px} px"
        )
    return sensor


def _look(light: _Light, polarity: str) -> Look:
    usual = DARK_DOTS if polarity == "dark" else LIGHT_DOTS
    ground, dot = (
        level if isinstance(level, float) else (level[0], level[1], level[2])
        for level in (
            usual.ground if light.ground is None else light.ground,
            usual.dot if light.dot is None else light.dot,
        )
    )
    return Look(
        ground=ground,
        dot=dot,
        **light.model_dump(include={"tilt_x", "tilt_y", "vignetting", "read_noise", "shot_noise"}),
        glare=tuple(spot.spot() for spot in light.glare),
        shadows=tuple(spot.spot() for spot in light.shadows),
    )
