"""Options for the parameters of methods, which several commands share."""

from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

from manytouch.cli.terminal.failures import usage_error
from manytouch.cli.terminal.options import positive

SURFACE = Group("Surface between the markers")


@dataclass(frozen=True, kw_only=True)
class SurfaceOptions:
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
        """Those that were given, by the names that the pipeline has for them.

        Raises:
            CycloptsError: a parameter of idw is given for a spline.
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
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            f"interpolation.{names.get(name, name)}": value
            for name, value in given.items()
            if value is not None
        }


Surface = Annotated[SurfaceOptions, Parameter(name="*")]
