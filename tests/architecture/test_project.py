"""What the project states about itself in several files agrees: version, addresses, extras, workflows."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import manytouch
from manytouch.session.diagnosis.installation import EXTRAS

ROOT = Path(__file__).parents[2]
if not (ROOT / "CITATION.cff").exists():
    pytest.skip("these files come with the repository, not with the wheel", allow_module_level=True)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
SCHEMAS = {
    "vendor.github-workflows": ".github/workflows/*.yml",
    "vendor.github-issue-forms": ".github/ISSUE_TEMPLATE/[!c]*.yml",
    "vendor.github-issue-config": ".github/ISSUE_TEMPLATE/config.yml",
    "vendor.dependabot": ".github/dependabot.yml",
    "vendor.citation-file-format": "CITATION.cff",
}


def test_the_version_is_the_same_everywhere() -> None:
    cited = re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert cited is not None
    assert PROJECT["version"] == manytouch.__version__ == cited[1]


def test_every_extra_is_listed_by_doctor() -> None:
    extras = PROJECT["optional-dependencies"]
    assert set(EXTRAS) == set(extras) - {"all", "dev", "docs"}
    for extra, (packages, _) in EXTRAS.items():
        required = {re.split(r"[<>=]", each)[0] for each in extras[extra]}
        assert set(packages) <= required


def test_the_tests_run_on_every_python_that_is_declared() -> None:
    declared = set(re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"])))
    workflow = (ROOT / ".github/workflows/tests.yml").read_text(encoding="utf-8")
    matrix = re.search(r"python: \[(.*)\]", workflow)
    assert matrix is not None
    assert set(re.findall(r"3\.\d+", matrix[1])) == declared


def test_links_of_the_readme_are_absolute_on_a_package_index() -> None:
    core = pytest.importorskip("hatchling.metadata.core")
    pytest.importorskip("hatch_fancy_pypi_readme")
    from hatchling.plugin.manager import PluginManager

    readme = core.ProjectMetadata(str(ROOT), PluginManager()).core.readme
    links = re.findall(r"\]\(([^)]+)\)", readme)
    assert links
    for link in links:
        assert re.match(r"https://(raw\.githubusercontent|github)\.com/", link), link
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", readme)
    assert pictures
    for link in pictures:
        assert (ROOT / link.partition("/main/")[2]).is_file(), link


@pytest.mark.parametrize("schema", SCHEMAS)
def test_files_of_the_forge_follow_their_schemas(schema: str) -> None:
    pytest.importorskip("check_jsonschema")
    files = sorted(ROOT.glob(SCHEMAS[schema]))
    assert files
    done = subprocess.run(
        [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, *files],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_demo_installs_a_part_of_what_the_tests_use() -> None:
    demo, tests = (
        set(re.findall(r"^[a-z0-9-]+==\S+", (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE))
        for name in ("requirements-demo.lock", "requirements.lock")
    )
    assert demo < tests, f"run make lock: {sorted(demo - tests)}"
    base = {re.split(r"[<>=]", each)[0] for each in PROJECT["dependencies"]}
    assert base <= {each.partition("==")[0] for each in demo}
