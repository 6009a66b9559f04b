"""Options for the parameters of methods, which several commands share."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter, Token

from manytouch.cli.terminal.failures import usage_error, usage_errors
from manytouch.cli.terminal.options import positive

SURFACE, PAPER = Group("Surface between the markers"), Group("Parameters of the method paper")


@dataclass(frozen=True, kw_only=True)
class InterpolationOptions:
    """How the surface is evaluated between the markers; None: the default of the method."""

    interpolation: Annotated[
        Literal["idw", "spline"] | None,
        Parameter(
            name="--interpolation",
            group=SURFACE,
            help="idw: inverse distance weighting, the surface of the paper. spline: smooth through the "
            "markers, or the spline of the sheet. [default: idw with --method paper, else spline]",
        ),
    ] = None
    iterations: Annotated[
        int | None,
        Parameter(
            name="--iterations",
            metavar="N",
            group=SURFACE,
            help="Points of the plane of idw along each side. [default: 100]",
        ),
    ] = None
    search_radius_pitch: Annotated[
        Any,
        Parameter(
            name="--search-radius-pitch",
            metavar="R",
            converter=positive("a radius"),
            n_tokens=1,
            group=SURFACE,
            help="Distance up to which a marker contributes to a point, in pitches. [default: 1.5]",
        ),
    ] = None
    power: Annotated[
        Any,
        Parameter(
            name="--power",
            metavar="P",
            converter=positive("a power"),
            n_tokens=1,
            group=SURFACE,
            help="Power of the distance in the weights of idw. [default: 2]",
        ),
    ] = None

    def parameters(self, verb: str, method: str | None) -> dict[str, Any]:
        """The options that were given, by the names that the pipeline has for them.

        Raises:
            CycloptsError: a parameter of idw is given for a spline, or is outside its limits.
        """
        if self.interpolation == "spline" or (self.interpolation is None and method != "paper"):
            numbers = (self.iterations, self.search_radius_pitch, self.power)
            if any(number is not None for number in numbers):
                raise usage_error(
                    verb,
                    "--iterations, --search-radius-pitch and --power are of the surface idw: add "
                    "--interpolation idw, or omit them",
                )
        names = {"interpolation": "kind"}
        options = {field.name: getattr(self, field.name) for field in fields(self)}
        given = {names.get(name, name): value for name, value in options.items() if value is not None}
        if given:
            from manytouch.values import Interpolation

            with usage_errors(verb):
                Interpolation(**given)
        return {f"interpolation.{name}": value for name, value in given.items()}


def _threshold(_: Any, tokens: Sequence[Token]) -> dict[str, int]:
    """A grey level, `otsu`, or `otsu` plus or minus a margin."""
    text = tokens[0].value
    found = re.fullmatch(r"otsu(?P<margin>[+-]\d{1,3})?|(?P<level>\d{1,3})", text)
    if found is None or int(found["level"] or 0) > 255:
        raise ValueError(f"expected a grey level from 0 to 255, otsu, or otsu+15, found {text!r}")
    if found["level"] is not None:
        return {"detect.threshold": int(found["level"])}
    return {"detect.margin": int(found["margin"] or 0)}


def _odd_side(_: Any, tokens: Sequence[Token]) -> int:
    text = tokens[0].value
    if not (text.isdecimal() and int(text) % 2):
        raise ValueError(f"expected an odd number of px from 1, found {text!r}")
    return int(text)


def _paper(name: str, words: str, metavar: str | None = None, converter: Any = None) -> Parameter:
    if converter is None:
        return Parameter(name=name, group=PAPER, metavar=metavar, help=words)
    return Parameter(name=name, group=PAPER, metavar=metavar, converter=converter, n_tokens=1, help=words)


@dataclass(frozen=True, kw_only=True)
class PaperOptions:
    """What the paper finds by trial and error; None: the default of the method."""

    threshold: Annotated[
        Any,
        _paper(
            "--threshold",
            "Grey level between dots and background. A number: fixed, as in the paper; otsu: Otsu's of each "
            "frame; otsu+15: a distance from it towards the dots. [default: from Otsu's, by trial]",
            "LEVEL|otsu|otsu+N",
            _threshold,
        ),
    ] = None
    opening_px: Annotated[
        Any,
        _paper(
            "--opening-px", "Side of the opening kernel, odd; 1: no opening. [default: 3]", "N", _odd_side
        ),
    ] = None
    opening_padding: Annotated[
        Literal["repeat", "none"] | None,
        _paper("--opening-padding", "Padding of the image before the opening. [default: repeat]"),
    ] = None
    minimum_area_px2: Annotated[
        Any,
        _paper(
            "--minimum-area-px2",
            "Smaller contours are not markers. [default: a quarter of a dot]",
            "A",
            positive("an area"),
        ),
    ] = None
    maximum_area_px2: Annotated[
        Any,
        _paper(
            "--maximum-area-px2",
            "Larger contours are not markers. [default: no limit]",
            "A",
            positive("an area"),
        ),
    ] = None
    gate_px: Annotated[
        Any,
        _paper(
            "--gate-px",
            "A dot that moves further between two frames gets a new identity. [default: 0.4 of the distance "
            "between neighbours]",
            "G",
            positive("a distance"),
        ),
    ] = None
    formula: Annotated[
        Literal["corrected", "printed", "side-lengths", "area", "unit-quads"] | None,
        _paper(
            "--formula",
            "Reading of equations 12 and 13: with the third term corrected, as printed, or other measures of "
            "the quads. [default: corrected]",
        ),
    ] = None
    padding: Annotated[
        Literal["repeat", "zero", "none"] | None,
        _paper(
            "--padding",
            "Depth of the markers at the edge (Figure 10): of their inner neighbours, 0, or not known. "
            "[default: repeat]",
        ),
    ] = None
    contact_depth_pitch: Annotated[
        Any,
        _paper(
            "--contact-depth-pitch",
            "Only peaks of the surface that are deeper are contacts, in pitches. [default: 0.25]",
            "D",
            positive("a depth"),
        ),
    ] = None

    def parameters(self, verb: str, method: str | None) -> dict[str, Any]:
        """The options that were given, by the names that the pipeline has for them.

        Raises:
            CycloptsError: the method is not `paper`.
        """
        names = {
            "opening_px": "detect.kernel_px",
            "opening_padding": "detect.opening_padding",
            "minimum_area_px2": "detect.minimum_area_px2",
            "maximum_area_px2": "detect.maximum_area_px2",
            "gate_px": "track.gate_px",
            "formula": "estimate.formula",
            "padding": "estimate.padding",
            "contact_depth_pitch": "estimate.contact_depth_pitch",
        }
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        found = {names[name]: value for name, value in given.items()} | (self.threshold or {})
        if found and method != "paper":
            words = ["threshold"] * (self.threshold is not None) + list(given)
            options = ", ".join(f"--{name.replace('_', '-')}" for name in words)
            raise usage_error(verb, f"only the method paper has {options}: add --method paper")
        if self.formula is not None:
            found["estimate.formula"] = self.formula.replace("-", "_")
        return found


WithInterpolation = Annotated[InterpolationOptions, Parameter(name="*")]
Paper = Annotated[PaperOptions, Parameter(name="*")]
