"""Writes the reference pages that follow from the code: commands, files, columns, statuses, viewer, names.

Names, units, defaults and limits come from the package; the sentences come from `meanings.toml`. A name
without a sentence, and a sentence without a name, is an error. `conf.py` calls `write_pages` before a build.
"""

import json
import re
import tomllib
import types
import typing
from collections.abc import Callable, Iterable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

import manytouch

PACKAGE = Path(manytouch.__file__).parent
MEANINGS = Path(__file__).with_name("meanings.toml")
HEAD = "<!-- written by docs/extensions/reference_pages.py; changes are lost -->\n"
UNITS = {
    "N_per_mm": "N/mm",
    "over_E_mm2": "mm²",
    "kg_m3": "kg/m³",
    "Nmm": "N mm",
    "mm2": "mm²",
    "MPa": "MPa",
    "rad": "rad",
    "mm": "mm",
    "px": "px",
    "N": "N",
    "s": "s",
}
MAX_ZERO = 1e-6  # smaller limits only exclude 0
LARGE = 10**9  # larger ones only exclude infinity


class MeaningError(Exception):
    """Names of the code and sentences of `meanings.toml` do not agree."""


def write_pages(folder: Path, *, in_repository: Path | None = None) -> list[Path]:
    """Write all pages, and return their paths.

    Args:
        folder: of the pages that only the site has.
        in_repository: folder of the page of the columns, which is also read without the site; None: `folder`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    pages: dict[str, Callable[[], str]] = {
        "commands": commands,
        "sensor-file-keys": sensor_file_keys,
        "columns": columns,
        "statuses": statuses,
        "environment": environment,
        "viewer-controls": viewer_controls,
        "api": api,
    }
    written = []
    for name, page in pages.items():
        path = ((in_repository or folder) if name == "columns" else folder) / f"{name}.md"
        text = page()
        if (
            not path.exists() or path.read_text(encoding="utf-8") != text
        ):  # unchanged pages are not built again
            path.write_text(text, encoding="utf-8")
        written.append(path)
    return written


def commands() -> str:
    """Every command and option, from the parser."""
    from manytouch.cli import COMMANDS, EPILOGUE
    from manytouch.cli.application import application

    text = application(tuple(COMMANDS)).generate_docs(output_format="markdown", recursive=True)
    text = text[text.index("## manytouch demo") :]
    text = re.sub(r"^(#+) manytouch (.+)$", r"(command-\2)=\n\1 manytouch \2", text, flags=re.MULTILINE)
    text = re.sub(r"\(command-([^)]*)\)=", lambda found: f"(command-{found[1].replace(' ', '-')})=", text)
    text = re.sub(r"\]\(#manytouch-([a-z-]+)\)", r"](#command-\1)", text)
    text = re.sub(r"^### (manytouch )", r"## \1", text, flags=re.MULTILINE)
    text = re.sub(r"^(Example: )(.+)$", r"\1`\2`\n", text, flags=re.MULTILINE)
    return f"{HEAD}# Commands\n\n{EPILOGUE.strip()}\n\n{text}\n"


def sensor_file_keys() -> str:
    """Every key of the sensor file, from the model that reads it."""
    from manytouch.values.sensor_file.schema import (
        CameraSection,
        MarkersSection,
        NoiseSection,
        PoseSection,
        SensorFile,
        SheetSection,
    )

    parts = [
        f"{HEAD}# Keys of the sensor file\n\n[The sensor file](../sensor-file.md) describes how deviations "
        "and bonded pads work. *Required* means: within its section. All numbers are finite.\n"
    ]
    sections: list[tuple[str, str, type[BaseModel]]] = [
        ("At the top", "sensor_file", SensorFile),
        ("`[camera]`", "sensor_file_camera", CameraSection),
        ("`[camera.pose]`", "sensor_file_camera_pose", PoseSection),
        ("`[sheet]`", "sensor_file_sheet", SheetSection),
        ("`[markers]`", "sensor_file_markers", MarkersSection),
        ("`[noise]`", "sensor_file_noise", NoiseSection),
    ]
    for title, group, model in sections:
        parts.append(f"## {title}\n\n{_keys(group, model)}\n")
    parts.append(
        "## `[provenance]`\n\nFree keys. Those that commands write, and the two that have an effect, "
        "`nominal` and `nominal_shape`, are in [the sensor file](../sensor-file.md#provenance).\n"
    )
    return "\n".join(parts)


def _keys(group: str, model: type[BaseModel]) -> str:
    fields = {field.alias or name: field for name, field in model.model_fields.items()}
    own = [name for name in fields if "_std" not in name]
    meaning = meanings(group, own)
    rows = []
    for name in own:
        field = fields[name]
        std = _std_key(name)
        deviation = f"`{std}`{_default_std(name)}" if std in fields else ""
        rows.append((f"`{name}`", meaning[name], _unit(name), _default(field), _allowed(field), deviation))
    return _table(("key", "meaning", "unit", "default", "allowed", "standard deviation, default"), rows)


def _std_key(name: str) -> str:
    if name == "size_mm":
        return "outline_std_mm"
    for unit in sorted(UNITS, key=len, reverse=True):
        if name.endswith(f"_{unit}"):
            return f"{name.removesuffix(f'_{unit}')}_std_{unit}"
    return f"{name}_std"


def _default_std(name: str) -> str:
    from math import degrees

    from manytouch.values.sensor_file import default_std as std

    relative = {
        "thickness_mm": std.THICKNESS_SHARE,
        "young_MPa": std.YOUNG_SHARE,
        "pretension_N_per_mm": std.PRETENSION_SHARE,
        "marker_depth_mm": std.MARKER_DEPTH_SHARE,
        "window_mm": std.WINDOW_SHARE,
        "fx_px": std.FOCAL_SHARE,
        "fy_px": std.FOCAL_SHARE,
    }
    other = {
        "size_mm": f"{std.OUTLINE_STD_MM:g} mm, of each side",
        "poisson": f"{std.POISSON_STD:g}",
        "bending_factor": f"{std.BENDING_SHARE:g}",
        "window_index": f"{std.INDEX_STD:g}",
        "pad_index": f"{std.INDEX_STD:g}",
        "cx_px": f"{std.FOCAL_SHARE:.1%} of the focal length",
        "cy_px": f"{std.FOCAL_SHARE:.1%} of the focal length",
        "distortion": "0",
        "rotation_vector": f"{degrees(std.ROTATION_STD_RAD):g}° about each axis",
        "translation_mm": f"{std.TRANSLATION_SHARE:.1%} of the distance along each axis",
        "density_kg_m3": "not used",
    }
    text = f"{100 * relative[name]:g} %" if name in relative else other[name].replace("%", " %")
    return f", {text}"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "*required*"
    value = field.get_default(call_default_factory=True)
    if value is None:
        return "absent"
    return f"`{value!r}`".replace("'", '"') if not isinstance(value, tuple) else f"`{list(value)}`"


def _allowed(field: FieldInfo) -> str:
    inner = _kind(field.annotation)
    limits = _limits(field.metadata)
    return " ".join(filter(None, (inner, limits)))


def _kind(annotation: Any) -> str:  # noqa: PLR0911 - one kind of type per line
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        metadata = [part for each in arguments[1:] for part in getattr(each, "metadata", [each])]
        return " ".join(filter(None, (_kind(arguments[0]), _limits(metadata))))
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_kind(each) for each in arguments if each is not type(None))
    if origin is typing.Literal:
        return ", ".join(f'`"{each}"`' for each in arguments)
    if origin is list:
        return f"list of: {_kind(arguments[0])}"
    if origin is tuple:
        return f"[{', '.join(_kind(each) for each in arguments)}]"
    if origin is dict:
        return "table"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "section"
    return {float: "number", int: "integer", str: "text"}[annotation]


def _limits(metadata: Iterable[Any]) -> str:
    found: dict[str, Any] = {}
    for each in metadata:
        for name in ("ge", "gt", "le", "lt", "min_length", "max_length"):
            value = getattr(each, name, None)
            if value is not None and abs(value) < LARGE:
                found[name] = value
    texts = []
    if 0 < found.get("ge", 0) < MAX_ZERO:
        found["gt"] = 0
        del found["ge"]
    if found.get("ge") is not None and found.get("ge") == found.get("le"):
        texts.append(f"{found.pop('ge'):g}")
        del found["le"]
    if "ge" in found and "le" in found:
        texts.append(f"{found.pop('ge'):g} to {found.pop('le'):g}")
    signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
    texts += [f"{sign} {found[name]:g}" for name, sign in signs.items() if name in found]
    if "max_length" in found:
        is_exact = found.get("min_length") == found["max_length"]
        texts.append(f"({'' if is_exact else 'at most '}{found['max_length']})")
    return " ".join(texts)


def columns() -> str:
    """Every column of the tables that are written, from the lists that write them."""
    from manytouch.batch import failures
    from manytouch.batch.result_tables import RESULTS
    from manytouch.rigs import run_rig
    from manytouch.sinks.files.regions import region_schema
    from manytouch.sinks.files.tables import (
        FRAME_COLUMNS,
        contact_column_names,
        contact_list_column_names,
        marker_column_names,
    )

    tables = [
        ("contacts.csv", "One line per contact and frame.", "contacts_csv", contact_column_names("mm")),
        (
            "contact_list.csv",
            "One line per contact, with its values at the peak.",
            "contact_list_csv",
            contact_list_column_names("mm"),
        ),
        ("markers.parquet", "One line per marker and frame.", "markers_parquet", marker_column_names("mm")),
        ("frames.csv", "One line per frame.", "frames_csv", FRAME_COLUMNS),
        (
            "regions.parquet",
            "One line per outline of a contact; none where the mechanics of the sheet are not known.",
            "regions_parquet",
            region_schema("mm").names,
        ),
        (
            "contacts.csv of a rig",
            "One line per contact and frame of every sensor, see [rigs](rigs.md).",
            "rig_contacts_csv",
            run_rig.COLUMNS,
        ),
        (
            "results.parquet of a batch",
            "One line per recording, see [batches](batch.md). `contacts.parquet` has the columns of all "
            "`contacts.csv`, after `name` and `unit`.",
            "results_parquet",
            RESULTS.names,
        ),
        ("failures.csv of a batch", "One line per recording that failed.", "failures_csv", failures.COLUMNS),
    ]
    parts = [
        f"{HEAD}# Columns of the results\n\nIf nothing gives the scale of a recording, lengths are in "
        "pitches, and `pitch` stands in the place of `mm` in the names. An empty cell, or null, means *not "
        "known*; it is never 0 by default. "
        "Select columns by name: [later versions may add some](stability.md).\n"
    ]
    for title, sentence, group, names in tables:
        meaning = meanings(group, names)
        rows = [(f"`{name}`", _unit(name), meaning[name]) for name in names]
        parts.append(f"## {title}\n\n{sentence}\n\n{_table(('column', 'unit', 'meaning'), rows)}\n")
    names = _summary_keys()
    meaning = meanings("summary_json", names)
    table = _table(("key", "meaning"), [(f"`{name}`", meaning[name]) for name in names])
    parts.append(
        f"## summary.json\n\nThe run as a whole. A value that is not known is null; later versions may add "
        f"keys.\n\n{table}\n"
    )
    return "\n".join(parts)


def _summary_keys() -> list[str]:
    """Keys of a summary, in its order, those of `counts` after it."""
    import tempfile

    from manytouch.session.methods import DEFAULT, pipeline_for
    from manytouch.simulation.demo_sensor import demo_sensor
    from manytouch.sinks.files.summary import Summary

    summary = Summary(sensor=demo_sensor(), pipeline=pipeline_for(DEFAULT), method=DEFAULT, recording={})
    with tempfile.TemporaryDirectory() as folder:
        summary.save(Path(folder), is_complete=True, hashes={})
        content = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    inner = [f"counts.{name}" for name in content["counts"]]
    return [each for name in content for each in ([name, *inner] if name == "counts" else [name])]


def statuses() -> str:
    """Every status of a frame with its remedy."""
    from manytouch.values import Status

    rows = [(f"`{each}`", each.remedy or "The frame was evaluated.") for each in Status]
    table = _table(("status", "remedy"), rows)
    return (
        f"{HEAD}# Statuses of frames\n\nA frame that cannot be evaluated never ends the program: it has a "
        f"status in `frames.csv`, in the viewer and in `reading.status`.\n\n{table}\n"
    )


def environment() -> str:
    """Every variable of the environment that the package reads or sets."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py")))
    names = re.findall(r'environ(?:\.get\(|\.setdefault\(|\[)"([A-Z_0-9]+)"', text)
    names += re.findall(r'"([A-Z_0-9]+)" (?:not )?in os\.environ', text)
    names += re.findall(r'"([A-Z]+_(?:NUM|MAXIMUM)_THREADS)"', text)
    names += re.findall(r'^[A-Z_]*VARIABLE = "([A-Z_]+)"', text, re.MULTILINE)
    names += [name for name in ("NUMBA_CACHE_DIR", "CYCLONEDDS_URI") if name in text]  # read by libraries
    meaning = meanings("environment", list(dict.fromkeys(names)))
    rows = [(f"`{name}`", sentence) for name, sentence in meaning.items()]
    return f"{HEAD}# Environment variables\n\nNone is needed.\n\n{_table(('variable', 'effect'), rows)}\n"


def viewer_controls() -> str:
    """Every control of the viewer's page with its explanation, and the keys."""
    page = _Page()
    page.feed((PACKAGE / "sinks/viewer/page/index.html").read_text(encoding="utf-8"))
    rows = [(f"**{name}**", text) for name, text in page.controls]
    keys = [(" ".join(f"`{key}`" for key in names.split()), action) for names, action in page.keys]
    return (
        f"{HEAD}# Controls of the viewer\n\nThe same sentences appear when the pointer rests on a control. "
        f"[The viewer](../viewer.md) describes the panes.\n\n{_table(('control', 'effect'), rows)}\n\n"
        f"## Keys\n\n{_table(('key', 'action'), keys)}\n"
    )


class _Page(HTMLParser):
    """Collects elements with a title, and the rows of the table of keys."""

    def __init__(self) -> None:
        super().__init__()
        self.controls: list[tuple[str, str]] = []
        self.keys: list[tuple[str, str]] = []
        self._title = ""
        self._label = ""
        self._cells: list[str] | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if given.get("title") and tag in ("button", "label", "select", "span", "canvas"):
            self._finish()
            self._title = given["title"]
            self._label = (
                given.get("aria-label") or given.get("id", "")
                if tag != "button"
                else given.get("aria-label", "")
            )
        elif tag == "select" and self._title and not self._label:
            self._label = given.get("aria-label", "")
        if tag == "table":
            self._cells = [] if given.get("class") == "keys" else None
        if tag == "td" and self._cells is not None:
            self._cells.append("")

    def handle_data(self, data: str) -> None:
        if self._cells:
            self._cells[-1] += data
        elif self._title and not self._label and data.strip():
            self._label = data.strip()

    def handle_endtag(self, tag: str) -> None:
        if tag in ("button", "label", "select", "canvas"):
            self._finish()
        if tag == "table" and self._cells is not None:
            pairs = zip(self._cells[::2], self._cells[1::2], strict=True)
            self.keys = [(name.strip(), action.strip()) for name, action in pairs]
            self._cells = None

    def _finish(self) -> None:
        if self._title and (self._label, self._title) not in self.controls:
            label = self._label.replace("-", " ") or "control"
            if not label.startswith("enlarge ") or not any(name == "enlarge" for name, _ in self.controls):
                self.controls.append(("enlarge" if label.startswith("enlarge ") else label, self._title))
        self._title = self._label = ""


def api() -> str:
    """Directives that document every public name from its docstring, by purpose."""
    purposes = {
        "Process recordings and streams": (
            "manytouch.session",
            "manytouch.session.stream",
            "manytouch.sources",
        ),
        "Results and plots": ("manytouch.analysis.read_results", "manytouch.analysis.plots"),
        "Sensors": (
            "manytouch.values.sensor_file.read",
            "manytouch.values.sensor_file.write",
            "manytouch.calibration",
        ),
        "Simulation": ("manytouch.simulation.contacts",),
        "Values": ("manytouch.values", "manytouch.geometry.surface_sampling"),
        "Parts of a pipeline": ("manytouch.pipeline",),
        "Errors": ("manytouch.errors",),
    }
    known = {module for modules in purposes.values() for module in modules}
    if known != set(manytouch._NAMES):
        raise MeaningError(f"modules without a purpose, or unknown: {known ^ set(manytouch._NAMES)}")
    parts = [
        f"{HEAD}# Python\n\nEverything here is imported from `manytouch`; the modules below it may move.\n"
    ]
    for purpose, modules in purposes.items():
        parts.append(f"## {purpose}\n")
        for module in modules:
            for name in manytouch._NAMES[module]:
                value = getattr(manytouch, name)
                if isinstance(value, tuple):
                    entry = f".. py:data:: manytouch.{name}\n   :value: {value!r}\n"
                elif isinstance(value, type):
                    entry = f".. autoclass:: manytouch.{name}\n   :members:\n"
                else:
                    entry = f".. autofunction:: manytouch.{name}\n"
                parts.append(f"```{{eval-rst}}\n{entry}```\n")
    return "\n".join(parts)


def meanings(group: str, names: Iterable[str]) -> dict[str, str]:
    """The sentence of each name, in the order of the names.

    Raises:
        MeaningError: a name has no sentence, or a sentence no name.
    """
    listed: dict[str, str] = tomllib.loads(MEANINGS.read_text(encoding="utf-8"))[group]
    names = list(names)
    if missing := [name for name in names if name not in listed]:
        raise MeaningError(f"describe {', '.join(missing)} in [{group}] of docs/extensions/meanings.toml")
    if unused := [name for name in listed if name not in names]:
        raise MeaningError(f"remove {', '.join(unused)} from [{group}] of docs/extensions/meanings.toml")
    return {name: listed[name] for name in names}


def _unit(name: str) -> str:
    for suffix, unit in UNITS.items():
        if name.endswith(f"_{suffix}"):
            return unit
    return ""


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
