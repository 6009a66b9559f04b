"""What a settings page shows of parameters: help from the docstrings, defaults, the few that matter most."""

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

from manytouch.session.methods.parameters import parameters_of
from manytouch.session.methods.pipelines import pipeline_for
from manytouch.values import ParameterInfo, Roi

ESSENTIAL = {
    "detect.least_share": ("Least contrast of a dot", "of the usual one"),
    "track.least_share": ("Least share of markers", "of all"),
    "estimate.contact_rules.start_stds": ("Significance of a new contact", "standard deviations"),
    "estimate.contact_rules.start_force": ("Least force of a new contact", "times the weakest"),
    "estimate.contact_finder.peaks.start_load": ("Least load of a new contact", "relative"),
    "estimate.uncalibrated_contact_finder.peaks.start_load": (
        "Least load of a new contact, unknown sensor",
        "relative",
    ),
    "estimate.contact_tracker.bridge_frames": ("Gap within a contact", "frames"),
    "estimate.contact_finder.tracker.bridge_frames": ("Gap within a contact", "frames"),
    "estimate.reference_drift.time_constant_s": ("Time constant of the drift of the reference", "s"),
    "detect.threshold": ("Threshold", "grey levels"),
    "detect.kernel_px": ("Side of the opening", "px"),
    "detect.minimum_area_px2": ("Smallest dot", "px²"),
    "detect.maximum_area_px2": ("Largest dot", "px²"),
    "track.gate_px": ("Farthest motion per frame", "px"),
    "estimate.formula": ("Reading of the formula", ""),
    "estimate.padding": ("Depth at the edge", ""),
    "estimate.contact_depth_pitch": ("Least depth of a contact", "pitches"),
    "interpolation.kind": ("Surface between markers", ""),
}
"""Parameters that are shown first, those that a method has: label and unit."""

FURTHER = {
    "interpolation.iterations": ("Inverse distance: points along a side", ""),
    "interpolation.search_radius_pitch": ("Inverse distance: search radius", "pitches"),
    "interpolation.power": ("Inverse distance: power", ""),
}
"""Label and unit of others that every method has; shown first with `paper`, where they are found by trial."""

UNITS = {
    "_px2": "px²",
    "_px": "px",
    "_mm": "mm",
    "_pitch": "pitches",
    "_rad": "rad",
    "_frames": "frames",
    "_s": "s",
}


@cache
def parameter_info(method: str) -> Mapping[str, ParameterInfo]:
    """Label, unit, help and default of each parameter of a method, those that matter most first."""
    pipeline = pipeline_for(method)
    help_of: dict[str, str] = {}
    for stage in fields(pipeline):
        help_of |= dict(_docs(getattr(pipeline, stage.name), f"{stage.name}."))
    defaults = parameters_of(pipeline)
    first = ESSENTIAL | (FURTHER if method == "paper" else {})
    order = {name: place for place, name in enumerate(first)}
    found = {}
    for name in sorted(defaults, key=lambda each: order.get(each, len(order))):
        label, unit = (ESSENTIAL | FURTHER).get(
            name, ("", next((unit for end, unit in UNITS.items() if name.endswith(end)), ""))
        )
        found[name] = ParameterInfo(
            label=label or name.replace(".", " › ").replace("_", " "),
            unit=unit,
            help=_without_code(help_of.get(name) or help_of.get(f"estimate.{name}", "")),
            default=defaults[name],
            is_essential=name in first,
        )
    return MappingProxyType(found)


def _without_code(text: str) -> str:
    """A docstring for readers of a page: without references to modules, names as in the labels."""
    text = re.sub(r" \(`[\w.]+`\)", "", text)
    text = re.sub(r"(^|\. )None:", r"\1Automatic:", text).replace("None:", "automatic:")
    return re.sub(r"`([\w.]+)`", lambda found: found[1].replace(".", " › ").replace("_", " "), text)


def _docs(value: Any, path: str) -> Iterator[tuple[str, str]]:
    """Path and docstring of each field of nested dataclasses."""
    if not is_dataclass(value) or isinstance(value, Roi | type):
        return
    texts = attribute_docs(inspect.getdoc(type(value)) or "")
    for field in fields(value):
        name = f"{path}{field.name}"
        yield name, texts.get(field.name, "")
        yield from _docs(getattr(value, field.name), f"{name}.")


def attribute_docs(docstring: str) -> dict[str, str]:
    """Texts of the section `Attributes:` of a docstring, by name; several names may share a text."""
    _, _, section = docstring.partition("Attributes:\n")
    section = re.split(r"\n\S", section)[0]
    texts: dict[str, str] = {}
    for match in re.finditer(r"^    (\w[\w, ]*): (.*(?:\n     .*)*)", section, re.MULTILINE):
        text = " ".join(match[2].split())
        texts |= {name.strip(): text[:1].upper() + text[1:] for name in match[1].split(",")}
    return texts
