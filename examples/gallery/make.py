"""Runs all examples of the gallery and writes their pictures to docs/images/gallery: `make gallery`."""

import runpy
import sys
from pathlib import Path

import matplotlib as mpl

HERE = Path(__file__).parent
PICTURES = HERE.parents[1] / "docs" / "images" / "gallery"


def main(names: list[str]) -> None:
    """Run the examples with these names, or all."""
    mpl.use("Agg")
    PICTURES.mkdir(parents=True, exist_ok=True)
    for script in sorted(HERE.glob("*.py")):
        if script.name != Path(__file__).name and (not names or script.stem in names):
            print(f"== {script.stem}", flush=True)
            runpy.run_path(str(script))["main"](str(PICTURES / f"{script.stem}.png"))


if __name__ == "__main__":
    main(sys.argv[1:])
