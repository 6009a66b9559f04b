"""The documentation: links, tables of contents, generated reference, and the site as a whole."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from manytouch.sinks.files.tables import contact_column_names
from manytouch.values import Status
from manytouch.values.sensor_file.schema import SheetSection

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
if not (DOCS / "conf.py").exists():
    pytest.skip("the pages come with the repository, not with the wheel", allow_module_level=True)
GENERATED = {DOCS / "_build", DOCS / "generated"}
PAGES = sorted(
    path
    for path in [*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *(ROOT / "benchmarks").rglob("*.md")]
    if not GENERATED & set(path.parents)
)
LINK = re.compile(r"(?<!`)\]\((?!https?:|mailto:)([^)\s]+)\)")


def slug(heading: str) -> str:
    """Anchor of a heading, as GitHub and MyST form it."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def anchors(page: Path) -> set[str]:
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return {slug(heading) for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE)}


def broken(page: Path) -> list[str]:
    wrong = []
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for link in LINK.findall(text):
        target, _, anchor = link.partition("#")
        place = (page.parent / target).resolve() if target else page
        is_missing = not place.exists()
        if is_missing or (anchor and place.suffix == ".md" and anchor not in anchors(place)):
            wrong.append(link)
    return wrong


@pytest.fixture
def reference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    monkeypatch.syspath_prepend(str(DOCS / "extensions"))
    import reference_pages

    return {path.stem: path.read_text(encoding="utf-8") for path in reference_pages.write_pages(tmp_path)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_internal_links_lead_to_pages_and_headings(page: Path) -> None:
    assert not broken(page)


def test_a_broken_link_and_a_missing_heading_are_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# One\n[a](no.md) [b](#one) [c](#two) [d](page.md#one)\n", encoding="utf-8")
    assert broken(page) == ["no.md", "#two"]


def test_every_page_is_in_a_table_of_contents() -> None:
    listed = {"index"}
    for page in DOCS.glob("*.md"):
        for block in re.findall(
            r"^```\{toctree\}\n(.*?)^```", page.read_text("utf-8"), re.MULTILINE | re.DOTALL
        ):
            listed |= {line.strip() for line in block.splitlines() if line and not line.startswith(":")}
    missing = {page.stem for page in DOCS.glob("*.md")} - listed
    assert not missing, f"add {missing} to the toctree of docs/guides.md, reference.md or explanation.md"


def test_the_reference_describes_what_the_code_has(reference: dict[str, str]) -> None:
    for status in Status:
        assert f"`{status}` | {status.remedy}" in reference["statuses"]
    for column in contact_column_names("mm"):
        assert f"| `{column}` |" in reference["columns"]
    for key in SheetSection.model_fields:
        assert f"`{key}`" in reference["sensor-file-keys"]
    assert (
        "| `poisson` | Poisson's ratio; absent: 0.45, of a pad 0.48 |  | absent | number ≥ 0 < 0.5 | "
        "`poisson_std`, 0.02 |" in reference["sensor-file-keys"]
    )
    for command in ("process", "calibrate rest", "recording repair", "design"):
        assert f"## manytouch {command}\n" in reference["commands"]
    assert "`--pitch-mm P|X,Y`" in reference["commands"]
    assert "**Tare** | Use the present marker positions" in reference["viewer-controls"]
    assert "`MANYTOUCH_STATES`" in reference["environment"]
    assert "autoclass:: manytouch.Reading" in reference["api"]


def test_the_columns_in_the_repository_are_those_of_the_code(reference: dict[str, str]) -> None:
    page = DOCS / "columns.md"
    assert page.read_text(encoding="utf-8") == reference["columns"], "run make docs, commit docs/columns.md"


def test_a_name_without_a_sentence_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS / "extensions"))
    import reference_pages

    with pytest.raises(reference_pages.MeaningError, match="describe nonsense_mm in"):
        reference_pages.meanings("frames_csv", ["frame", "nonsense_mm"])
    with pytest.raises(reference_pages.MeaningError, match="remove time_s"):
        reference_pages.meanings("frames_csv", ["frame"])


@pytest.mark.slow
def test_the_site_is_built_without_warnings_and_needs_no_network(tmp_path: Path) -> None:
    pytest.importorskip("furo")
    words = ["-b", "html", "-E", "-W", "--keep-going", "-q", str(DOCS), str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    pages = list(tmp_path.rglob("*.html"))
    assert len(pages) > 100
    for page in pages:
        text = page.read_text(encoding="utf-8")
        loaded = re.findall(r"<(?:script|img|iframe)[^>]*src=\"([^\"]+)", text)
        loaded += re.findall(r"<link[^>]*rel=\"stylesheet\"[^>]*href=\"([^\"]+)", text)
        for address in loaded:
            assert "//" not in address, (page, address)
            assert (page.parent / address.partition("?")[0]).exists(), (page, address)
