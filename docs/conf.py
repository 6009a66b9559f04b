"""The documentation site: `make docs` builds it in docs/_build/html; it opens without a network."""

import re
import sys
import tomllib
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS / "extensions"))

from pygments.lexers.special import TextLexer  # noqa: E402
from reference_pages import write_pages  # noqa: E402 - from the folder above

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
REPOSITORY = PROJECT["urls"]["Repository"]
OUTSIDE = {
    "CHANGELOG.md": "changelog",
    "CODE_OF_CONDUCT.md": "conduct",
    "CONTRIBUTING.md": "contributing",
    "SECURITY.md": "security",
}

project = "manytouch"
author = PROJECT["authors"][0]["name"]
project_copyright = author
version = release = PROJECT["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "offline_math"]
exclude_patterns = ["_build", "extensions"]
nitpicky = False
default_role = "code"

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # pages of the repository may begin below the first level

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_preserve_defaults = True
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"manytouch {release}"
html_favicon = "../src/manytouch/sinks/viewer/page/icon.svg"
html_static_path: list[str] = []
html_copy_source = False
html_show_sphinx = False
html_math_renderer = "mathml"
templates_path: list[str] = []


def _copy_pages_of_the_repository() -> None:
    """Pages that lie above docs/, such as the changelog, with links that are correct in docs/generated."""
    for name, page in OUTSIDE.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        text = re.sub(r"\]\((?!https?:|#)([^)]+)\)", r"](../../\1)", text)
        (DOCS / "generated" / f"{page}.md").write_text(text, encoding="utf-8")


def _link_inside_or_to_the_repository(page: Path, text: str) -> str:
    """Links that leave docs/ lead to the copies of these pages, else to the repository."""

    def resolved(found: re.Match[str]) -> str:
        target, hash_, anchor = found[1].partition("#")
        try:
            place = (page.parent / target).resolve().relative_to(ROOT)
        except ValueError:
            return found[0]
        if (ROOT / place / "README.md").is_file():
            place /= "README.md"
        if place.parts[:1] == ("docs",):
            return (
                "]("
                + str(Path(*[".."] * (len(page.relative_to(DOCS).parts) - 1), *place.parts[1:]))
                + (f"{hash_}{anchor})")
            )
        if str(place) in OUTSIDE:
            up = [".."] * (len(page.relative_to(DOCS).parts) - 1)
            return f"]({Path(*up, 'generated', OUTSIDE[str(place)])}.md{hash_}{anchor})"
        return f"]({REPOSITORY}/blob/main/{place})"

    return re.sub(r"\]\(((?:\.\./)+[^)#]*(?:#[^)]*)?)\)", resolved, text)


def setup(app: object) -> None:
    """Write the pages that follow from the code, before they are read."""
    write_pages(DOCS / "generated", in_repository=DOCS)
    _copy_pages_of_the_repository()

    def on_read(_app: object, docname: str, content: list[str]) -> None:
        content[0] = _link_inside_or_to_the_repository(DOCS / f"{docname}.md", content[0])
        if docname == "decisions/README":
            content[0] += "\n```{toctree}\n:hidden:\n:glob:\n\n0*\n```\n"

    app.add_lexer("csv", TextLexer)  # type: ignore[attr-defined]
    app.connect("source-read", on_read)  # type: ignore[attr-defined]
