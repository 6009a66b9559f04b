"""Scene files: their content and their mistakes."""

# ruff: noqa: E501 - inline tables of TOML stand on one line

from pathlib import Path

import numpy as np
import pytest

from manytouch.errors import SensorError, SourceError
from manytouch.simulation.fem.contact.indenters import (
    ConvexBody,
    Fingertip,
    LyingCylinder,
    RoundPunch,
    SquarePunch,
)
from manytouch.simulation.scene.bodies import mesh_corners
from manytouch.simulation.scene.file import BUILT_IN, built_in_scenes, load_scene, scene_path
from manytouch.simulation.solve_scene import simulator, solid_problem, solve_scene, state_count
from manytouch.values.sensor_file.write import save_sensor

TETRAHEDRON = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 3 3 6\nf 1 2 3\n"
EVERYTHING = """
schema = 1
name = "everything"
seconds = 6.0
fps = 12.5
seed = 7
sensor = "demo"
width_px = 640

[solid]
element_mm = 4.0
layers = 2
step_mm = 2.0

[light]
ground = [30.0, 40.0, 50.0]
dot = 220.0
tilt_x = 0.1
vignetting = 0.2
glare = [{ centre_px = [100.0, 80.0], radius_px = 20.0, amount = 50.0 }]
shadows = [{ centre_px = [10.0, 8.0], radius_px = 5.0, amount = 0.5 }]
read_noise = 1.5
shot_noise = 0.03
flicker = 0.1
flicker_Hz = 100.0

[lens]
blur_px = 0.6
aperture_mm = 2.0
focus_mm = 115.0
exposure_s = 0.004
jpeg_quality = 85

[faults]
missing = 3
half_printed = 2
dust = 12
body_shadow = 0.3

[[bodies]]
shape = { kind = "fingertip", semi_axes_mm = [6.0, 8.0, 5.0] }
friction = 0.4
motions = [
  { kind = "press", at_mm = [0.0, 0.0], depth_mm = 2.0, start_s = 0.5, end_s = 1.5, turn_deg = [0.0, 0.0, 90.0] },
  { kind = "slide", from_mm = [0.0, 0.0], to_mm = [9.0, 0.0], depth_mm = 2.0, start_s = 2.0, end_s = 3.0 },
  { kind = "tap", at_mm = [4.0, 4.0], depth_mm = 1.0, start_s = 3.5, times = 2 },
]

[[bodies]]
shape = { kind = "cylinder", radius_mm = 5.0, length_mm = 12.0 }
motions = [{ kind = "roll", at_mm = [20.0, 0.0], direction_deg = 90.0, angle_deg = 60.0, depth_mm = 2.0, start_s = 1.0, end_s = 3.0 }]

[[bodies]]
shape = { kind = "round_punch", radius_mm = 4.0 }
motions = [{ kind = "close_in", centre_mm = [0.0, 20.0], direction_deg = 0.0, from_distance_mm = 30.0, to_distance_mm = 10.0, depth_mm = 2.0, start_s = 1.0, end_s = 3.0 }]

[[bodies]]
shape = { kind = "square_punch", side_mm = [6.0, 8.0] }
motions = [{ kind = "path", points = [[0.0, 0.0, -20.0, -1.0], [1.0, 0.0, -20.0, 2.0], [2.0, 5.0, -20.0, 0.0]] }]

[[bodies]]
shape = { kind = "mesh", file = "body.obj" }
motions = [{ kind = "press", at_mm = [-30.0, 0.0], depth_mm = 1.0, start_s = 0.5, end_s = 1.5 }]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_describes_everything(tmp_path: Path) -> None:
    (tmp_path / "body.obj").write_text(TETRAHEDRON)
    scene = load_scene(written(tmp_path, EVERYTHING))
    assert (scene.name, scene.duration_s, scene.fps, scene.seed) == ("everything", 6.0, 12.5, 7)
    assert scene.sensor.camera.width_px == 640
    kinds = [type(body.indenter) for body in scene.bodies]
    assert kinds == [Fingertip, LyingCylinder, RoundPunch, RoundPunch, SquarePunch, ConvexBody]
    assert scene.bodies[0].friction == 0.4
    assert scene.look.ground == (30.0, 40.0, 50.0)
    assert (scene.look.glare[0].amount, scene.look.shadows[0].amount) == (50.0, 0.5)
    assert (scene.optics.jpeg_quality, scene.optics.flicker_Hz, scene.optics.exposure_s) == (85, 100.0, 0.004)
    assert (~scene.faults.is_printed).sum() == 3
    assert len(scene.faults.dust_mm) == 12
    model = solid_problem(scene).model
    assert (model.element_mm, model.layers, model.pretension_N_per_mm) == (4.0, 2, 0.4)
    assert model.size_mm == (120.0, 80.0)


def test_motions_follow_their_description(tmp_path: Path) -> None:
    (tmp_path / "body.obj").write_text(TETRAHEDRON)
    bodies = load_scene(written(tmp_path, EVERYTHING)).bodies
    (finger,), (roller,), (left, right), (punch,) = (
        [body for body in bodies if isinstance(body.indenter, kind)]
        for kind in (Fingertip, LyingCylinder, RoundPunch, SquarePunch)
    )

    def at(body: object, time_s: float) -> list[float]:
        return body.trajectory.at(np.array([time_s]))[0][0].tolist()  # type: ignore[attr-defined]

    assert at(finger, 1.0) == pytest.approx([0.0, 0.0, 2.0])
    assert at(finger, 2.5) == pytest.approx([4.5, 0.0, 2.0])
    assert at(finger, 4.25) == pytest.approx([4.0, 4.0, 1.0])
    assert finger.trajectory.at(np.array([1.0]))[1][0] == pytest.approx([0.0, 0.0, np.pi / 2])
    half_arc_mm = 0.5 * np.radians(60.0) * 5.0
    assert at(roller, 1.25) == pytest.approx([20.0, -half_arc_mm, 2.0])
    assert at(roller, 2.75) == pytest.approx([20.0, half_arc_mm, 2.0])
    assert roller.trajectory.at(np.array([2.75]))[1][0] == pytest.approx([-np.radians(30.0), 0.0, 0.0])
    assert (at(left, 1.25)[0], at(right, 1.25)[0]) == (-15.0, 15.0)
    assert (at(left, 2.75)[0], at(right, 2.75)[0]) == (-5.0, 5.0)
    assert at(punch, 1.0) == pytest.approx([0.0, -20.0, 2.0])


def test_all_mistakes_are_named_at_once(tmp_path: Path) -> None:
    text = EVERYTHING.replace("seconds = 6.0", "seconds = -6.0").replace("blur_px", "blurr_px")
    text = text.replace('kind = "cylinder"', 'kind = "no shape"').replace(
        "depth_mm = 1.0, start", "depth_mm = 0, start"
    )
    with pytest.raises(SourceError) as caught:
        load_scene(written(tmp_path, text))
    message = str(caught.value)
    for words in ("seconds = -6.0", "unknown key lens.blurr_px", "no shape", "depth_mm = 0"):
        assert words in message


def test_mistakes_between_keys_are_named_with_those_of_single_keys(tmp_path: Path) -> None:
    text = EVERYTHING.replace("seconds = 6.0", "seconds = 1e8").replace("seed = 7", "sede = 7")
    text = text.replace("width_px = 640", "width_px = 6").replace("end_s = 1.5, turn", "end_s = 0.6, turn")
    text = text.replace("angle_deg = 60.0", "angle_deg = true").replace(
        "[1.0, 0.0, -20.0, 2.0]", "[0, 0, 0, 2]"
    )
    with pytest.raises(SourceError) as caught:
        load_scene(written(tmp_path, text))
    message = str(caught.value)
    for words in (
        "sede",
        "too many frames",
        "at least 64 px",
        "do not fit",
        "angle_deg = True",
        "must increase",
    ):
        assert words in message, words


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("end_s = 1.5, turn", "end_s = 0.6, turn", "do not fit"),
        ("start_s = 2.0, end_s = 3.0", "start_s = 1.2, end_s = 3.0", "overlap"),
        ("[1.0, 0.0, -20.0, 2.0]", "[0.0, 0.0, -20.0, 2.0]", "must increase"),
        (
            "2.0], [2.0, 5.0, -20.0, 0.0]] }",
            "2.0]], turns_deg = [[0, 0, 9]] }",
            "1 rows are given for 2 points",
        ),
        ("missing = 3", "missing = 700", "more than the 600"),
        (
            "[1.0, 0.0, -20.0, 2.0]",
            "[1.0, 0.0, -20.0, 40.5]",
            r"points: a depth of 40\.5 mm .* at most 40 mm",
        ),
        ('sensor = "demo"', 'sensor = "nowhere.toml"', "does not exist"),
        ('file = "body.obj"', 'file = "none.obj"', "cannot read the mesh"),
        ("schema = 1", "schema = [", "not valid TOML"),
    ],
)
def test_a_mistake_is_reported(tmp_path: Path, old: str, new: str, words: str) -> None:
    (tmp_path / "body.obj").write_text(TETRAHEDRON)
    assert old in EVERYTHING
    with pytest.raises((SourceError, SensorError), match=words):
        load_scene(written(tmp_path, EVERYTHING.replace(old, new)))


@pytest.mark.parametrize(
    ("sensor", "deepest_mm", "limit"),
    [("demo", 40.0, "half of the shorter side"), ("pad", 4.0, "the thickness of this pad")],
)
def test_no_press_is_deeper_than_the_sheet_can_be_pressed(
    tmp_path: Path, sensor: str, deepest_mm: float, limit: str
) -> None:
    text = PAD.replace('sensor = "pad"', f'sensor = "{sensor}"')
    before, after = text.split("depth_mm = ")
    for depth_mm in (deepest_mm, deepest_mm + 0.5):
        depth = f"depth_mm = {depth_mm}"
        path = written(tmp_path, before + depth + after[after.index(",") :])
        if depth_mm == deepest_mm:
            load_scene(path)
            continue
        key = "bodies.0.motions.0.depth_mm: a depth of"
        with pytest.raises(SourceError, match=rf"{key} {depth_mm} mm .* at most {deepest_mm:g} mm, {limit}"):
            load_scene(path)


PAD = """
schema = 1
seconds = 1.0
sensor = "pad"

[[bodies]]
shape = { kind = "sphere", radius_mm = 3.0 }
motions = [{ kind = "press", at_mm = [4.0, 0.0], depth_mm = 0.5, start_s = 0.2, end_s = 0.8 }]
"""


@pytest.mark.parametrize(
    ("shape", "widest_mm"),
    [
        ('kind = "square_punch", side_mm = [4.0, 0.8]', 0.4),
        ('kind = "round_punch", radius_mm = 0.3', 0.3),
        ('kind = "cylinder", radius_mm = 3.0, length_mm = 0.6', 0.3),
    ],
)
def test_narrow_bodies_have_narrow_edges(tmp_path: Path, shape: str, widest_mm: float) -> None:
    ball = 'kind = "sphere", radius_mm = 3.0'
    assert ball in PAD
    scene = load_scene(written(tmp_path, PAD.replace(ball, shape)))
    assert scene.bodies[0].indenter.edge_radius_mm == pytest.approx(widest_mm)  # type: ignore[union-attr]
    with pytest.raises(SourceError, match=f"edge_radius_mm is 0.45, but .* at most {widest_mm:g} mm"):
        load_scene(written(tmp_path, PAD.replace(ball, f"{shape}, edge_radius_mm = 0.45")))


def test_a_pad_is_meshed_finely_where_bodies_touch(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, PAD))
    assert (scene.sensor.camera.width_px, scene.sensor.camera.height_px) == (640, 480)
    assert scene.mesh.step_mm == 0.25
    problem = solid_problem(scene)
    x_mm, _, z_mm = (np.array(line) for line in problem.model.lines_mm)  # type: ignore[union-attr]
    middle_mm, width_mm = 0.5 * (x_mm[1:] + x_mm[:-1]), np.diff(x_mm)
    assert width_mm[np.abs(middle_mm - 4.0) < 1.5].max() <= 0.6
    assert width_mm.max() > 1.5
    assert z_mm[0] == 0.0
    assert problem.pad_markers_mm == 3.5
    assert 3.5 in z_mm
    finer = load_scene(written(tmp_path, PAD + "[solid]\nlayers = 6\nelement_mm = 0.5\n"))
    assert len(solid_problem(finer).model.lines_mm[2]) == 8  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (PAD.replace("seconds", 'mechanics = "shell"\nseconds'), 'use "solid"'),
        (PAD.replace('"pad"', '"demo"') + "[solid]\ncontact_element_mm = 1.0\n", "is for bonded pads"),
        (PAD + "[solid]\ncontact_element_mm = 0.01\n", "elements of 0.01 mm"),
    ],
)
def test_settings_of_a_pad_that_do_not_fit_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(SourceError, match=words):
        load_scene(written(tmp_path, text))


def test_no_file_no_scene(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no scene file"):
        load_scene(tmp_path / "none.toml")
    with pytest.raises(SourceError, match="sim:fingers is a built-in scene"):
        load_scene("fingers")
    with pytest.raises(SourceError, match="schema is missing: give 1; seconds is missing"):
        load_scene(written(tmp_path, ""))


def test_a_sensor_file_next_to_the_scene_is_taken(tmp_path: Path) -> None:
    (tmp_path / "body.obj").write_text(TETRAHEDRON)
    path = written(tmp_path, EVERYTHING)
    save_sensor(load_scene(path).sensor, tmp_path / "my.toml")
    text = EVERYTHING.replace('sensor = "demo"\nwidth_px = 640', 'sensor = "my.toml"')
    assert load_scene(written(tmp_path, text)).sensor.camera.width_px == 640
    with pytest.raises(SensorError, match="640 px"):
        load_scene(written(tmp_path, text.replace("seed = 7", "seed = 7\nwidth_px = 500")))


@pytest.mark.parametrize("is_binary", [True, False])
def test_meshes_of_both_kinds_of_stl(tmp_path: Path, is_binary: bool) -> None:
    corner = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [3, 3, 6]], dtype="<f4")
    facets = corner[[[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]]]
    path = tmp_path / "body.stl"
    if is_binary:
        rows = b"".join(bytes(12) + facet.tobytes() + bytes(2) for facet in facets)
        path.write_bytes(bytes(80) + (4).to_bytes(4, "little") + rows)
    else:
        lines = [f"vertex {x} {y} {z}" for facet in facets for x, y, z in facet.tolist()]
        path.write_text("solid x\n" + "\n".join(lines))
    assert {tuple(row) for row in mesh_corners(path).tolist()} == {tuple(row) for row in corner.tolist()}
    path.write_text("nothing")
    with pytest.raises(SourceError, match="not a mesh of a solid"):
        mesh_corners(path)


def test_a_scene_is_named_by_its_path_or_as_a_built_in_one() -> None:
    assert load_scene(scene_path("sim:pad")).sensor.sheet.boundary == "bonded"
    assert scene_path("two.toml") == scene_path("sim:two.toml") == Path("two.toml")
    with pytest.raises(SourceError, match=r"no built-in scene 'sim:paw': use .*pad"):
        scene_path("sim:paw")


def test_built_in_scenes_are_there_and_sound() -> None:
    assert built_in_scenes() == ("fingers", "one", "pad", "rest", "skin")
    for name in built_in_scenes():
        scene = load_scene(BUILT_IN / f"{name}.toml", width_px=1280)
        assert scene.name == name
        camera = scene.sensor.camera
        assert camera.width_px / max(len(camera.views), 1) == 1280
        assert scene.fps == 30.0


def test_a_scene_on_the_shell_is_solved_at_once(tmp_path: Path) -> None:
    (tmp_path / "body.obj").write_text(TETRAHEDRON)
    text = EVERYTHING.replace('sensor = "demo"', 'sensor = "demo"\nmechanics = "shell"')
    scene = load_scene(written(tmp_path, text))
    states = tuple(solve_scene(scene, tmp_path / "none"))
    assert len(states) == state_count(scene)
    assert not (tmp_path / "none").exists()
    assert len(simulator(scene, states).truth(12).contacts.touching) >= 3


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ("seconds = 1e9", "too many frames"),
        ("seconds = 1.0\nwidth_px = 200000", "too many"),
        ("seconds = 1.0\n[solid]\nelement_mm = 1e-6", "choose a larger element_mm"),
        ("seconds = 1.0\n[solid]\nlayers = 1000000", "layers"),
        ("seconds = 1.0\n[faults]\ndust = 1000000000", "dust"),
        ("seconds = 1.0\nbodies = [" + "{}, " * 201 + "]", "bodies"),
    ],
)
def test_limits_of_a_scene(tmp_path: Path, changes: str, words: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(f"schema = 1\n{changes}\n")
    with pytest.raises(SourceError, match=words):
        load_scene(path)


def test_steps_that_are_too_small_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    (tmp_path / "body.obj").write_text(TETRAHEDRON)
    path.write_text(EVERYTHING.replace("step_mm = 2.0", "step_mm = 1e-7"))
    with pytest.raises(SourceError, match="choose a larger step_mm"):
        solid_problem(load_scene(path))


def test_a_mesh_that_is_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("manytouch.simulation.scene.bodies.MAX_MESH_BYTES", 10)
    (tmp_path / "big.obj").write_text(TETRAHEDRON)
    with pytest.raises(SourceError, match="simplify it"):
        mesh_corners(tmp_path / "big.obj")
