"""Each example runs, and prints one number that must be right."""

import json
import runpy
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import manytouch
from manytouch.sources.simulated import simulated_source

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> dict[str, object]:
    if not EXAMPLES.is_dir():
        pytest.skip("the examples come with the repository, not with the wheel")
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))


@pytest.mark.parametrize("fps", [5.0, pytest.param(10.0, marks=pytest.mark.slow)])
def test_read_the_simulated_sensor(
    fps: float, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With fewer frames than the example has."""
    monkeypatch.setattr(manytouch, "open_source", partial(manytouch.open_source, fps=fps))
    error_mm = example("read_the_simulated_sensor")["main"]()
    assert error_mm < 1.0
    assert "truth" in capsys.readouterr().out


@pytest.mark.slow
def test_the_notebook_runs_from_its_first_cell_to_its_last(capsys: pytest.CaptureFixture[str]) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    path = EXAMPLES / "contacts_on_a_sheet.ipynb"
    if not path.is_file():
        pytest.skip("the examples come with the repository, not with the wheel")
    names: dict[str, Any] = {}
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
    contact, results = names["contact"], names["results"]
    assert contact.centre_mm == pytest.approx([-20.0, 10.0], abs=0.5)
    assert -contact.force_N[2] > 0.5
    assert len(results.frames) == 30
    assert "depth" in capsys.readouterr().out
    assert names["force_axes"].get_ylabel() == "normal force (N)"
    pyplot.close("all")


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_the_environment_of_gymnasium_and_mujoco(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    checker = pytest.importorskip("gymnasium.utils.env_checker")
    names = example("press_with_mujoco")
    environment: Any = names["PressEnv"](render_mode="rgb_array")
    checker.check_env(environment)
    environment.action_space.seed(0)
    environment.reset(seed=0)
    for _ in range(150):
        observation, reward, *_ = environment.step(environment.action_space.sample())
        assert environment.observation_space.contains(observation)
        assert reward <= 0.0
    assert environment.render().shape == (720, 1280, 3)
    assert names["main"]() < 0.6
    assert capsys.readouterr().out.count("requested") == 3


GALLERY = {  # what each example returns, from and to
    "calibrate": (0.0, 0.01),  # error of the focal length
    "data_set": (20.0, 40.0),  # rows
    "design": (2.0, 8.0),  # pitch, mm
    "first_video": (0.0, 1.5),  # distance from the truth, mm
    "rig": (4.0, 20.0),  # contacts
    "ros2": (7.0, 9.0),  # N
    "shear": (0.0, 0.03),  # N
    "slip": (0.26, 0.36),  # coefficient of friction
    "soft_object": (1.4, 2.2),  # ratio of the radii
    "two_fingers": (0.0, 0.3),  # mm
}
QUICK = "calibrate"  # of a simulated sensor with fewer pixels


@pytest.mark.parametrize(
    ("name", "width_px"),
    [
        (QUICK, 800),
        pytest.param(QUICK, 1280, marks=pytest.mark.slow),
        *(pytest.param(name, None, marks=pytest.mark.slow) for name in GALLERY),
    ],
)
def test_an_example_of_the_gallery_draws_its_picture_and_is_right(
    name: str, width_px: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if width_px:
        small = simulated_source("one", width_px=width_px)
        monkeypatch.setattr(manytouch, "open_source", {"sim:one": small}.__getitem__)
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    picture = tmp_path / f"{name}.png"
    least, most = GALLERY[name]
    assert least <= example(f"gallery/{name}")["main"](str(picture)) <= most
    drawn = pyplot.imread(picture)
    assert min(drawn.shape[:2]) > 300
    assert drawn[..., :3].std() > 0.05
    pyplot.close("all")


def test_the_gallery_shows_every_example_with_its_picture() -> None:
    page = EXAMPLES.parent / "docs" / "gallery.md"
    if not page.is_file():
        pytest.skip("the pages come with the repository, not with the wheel")
    scripts = {path.stem for path in (EXAMPLES / "gallery").glob("*.py")} - {"make"}
    assert scripts == set(GALLERY)
    for name in scripts:
        assert f"(images/gallery/{name}.png)" in page.read_text(encoding="utf-8")
        assert f"literalinclude}} ../examples/gallery/{name}.py" in page.read_text(encoding="utf-8")
        assert (page.parent / "images" / "gallery" / f"{name}.png").is_file()
