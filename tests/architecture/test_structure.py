"""Names, sizes and places that keep the structure readable, and where tests lie."""

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

import manytouch

PACKAGE = Path(manytouch.__file__).parent
TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
MAX_ARGUMENTS = 8
KERNELS = ("kernel", "inlined_kernel", "intrinsic", "njit", "jit")
NO_ATTRIBUTES_OF_OTHERS = ("pipeline.py", "session", "sinks", "sources", "cli", "calibration")
NOT_PROBING = {
    # of modules and devices of others, which differ between versions
    "sources/quiet_opencv.py": "setLogLevel",
    "calibration/camera/board.py": "dictionary",
    # not on every system
    "sinks/output_process/messages.py": "writev",
    "sinks/output_process/worker.py": "nice",
    # generators have it, other iterators of frames do not
    "session/background_iterator.py": "close",
    # compiled functions have it
    "session/methods/pipelines.py": "stats cache_path",
}
NAMES_OF_OTHERS = {
    "_asdict",  # of named tuples
    "_exit",  # of os
    "_final_module",  # of numba
    "_replace",
    "_repr_html_",  # of notebooks
}
"""Attributes with an underscore that are documented by Python, notebooks and numba."""
DECISION = ("Context", "Decision", "Alternatives", "Status")

Function = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def trees() -> dict[str, ast.Module]:
    paths = sorted(PACKAGE.rglob("*.py"))
    return {
        path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text(encoding="utf-8")) for path in paths
    }


def test_a_module_has_a_docstring() -> None:
    assert not [module for module, tree in trees().items() if not ast.get_docstring(tree)]


def test_a_public_class_name_exists_once() -> None:
    found: defaultdict[str, list[str]] = defaultdict(list)
    for module, tree in trees().items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(module)
    assert not {name: modules for name, modules in found.items() if len(modules) > 1}


def test_kernels_have_few_arguments() -> None:
    """More of them are named tuples; functions of others have keywords."""
    many, count = [], 0
    for module, tree in trees().items():
        for node in tree.body:
            if isinstance(node, Function) and any(is_kernel(each) for each in node.decorator_list):
                count += 1
                # an intrinsic has the context of numba first
                own = [each.arg for each in node.args.args if each.arg != "typing"]
                if len(own) > MAX_ARGUMENTS:
                    many.append(f"{module}: {node.name}: {len(own)}")
    assert count > 300
    assert not many


def is_kernel(decorator: ast.expr) -> bool:
    function = decorator.func if isinstance(decorator, ast.Call) else decorator
    return isinstance(function, ast.Name) and function.id in KERNELS


def test_functions_have_few_positional_arguments() -> None:
    many = []
    for module, tree in trees().items():
        if module.startswith("cli/"):  # they are options there
            continue
        for node in ast.walk(tree):
            if isinstance(node, Function):
                own = {each.arg for each in node.args.posonlyargs + node.args.args}
                if len(own - {"self", "cls", "typing"}) > MAX_ARGUMENTS:
                    many.append(f"{module}: {node.name}: {len(own)}")
    assert not many


def test_no_module_needs_private_names_of_another() -> None:
    wrong = []
    for module, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("manytouch"):
                names = [*(node.module or "").split("."), *(each.name for each in node.names)]
                wrong += [f"{module}: {name}" for name in names if name.startswith("_") and name[1] != "_"]
    assert not wrong


def test_sources_and_stages_are_not_probed_for_attributes() -> None:
    """What a source can do is `Capabilities`; what a stage can do is in its protocol."""
    wrong = []
    for module, tree in trees().items():
        if module.split("/")[0] not in NO_ATTRIBUTES_OF_OTHERS:
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                is_probe = node.func.id == "hasattr" or (node.func.id == "getattr" and len(node.args) > 2)
                known = NOT_PROBING.get(module)
                if is_probe and not (known and ast.unparse(node.args[1]).strip("'") in known.split()):
                    wrong.append(f"{module}, line {node.lineno}: {ast.unparse(node)}")
    assert not wrong


def test_every_package_states_what_is_in_it() -> None:
    for module, tree in trees().items():
        if module.endswith("__init__.py"):
            assert len((ast.get_docstring(tree) or "").split()) >= 12, module


@pytest.mark.parametrize(
    ("tests", "code"), [("unit", PACKAGE), ("benchmarks", ROOT / "benchmarks")], ids=("unit", "benchmarks")
)
def test_tests_lie_where_the_code_lies(tests: str, code: Path) -> None:
    """`test_NAME.py` tests the module or package NAME; `test_NAME_aspect.py` does so too."""
    if not code.exists():
        pytest.skip("these files come with the repository, not with the wheel")
    wrong = []
    for path in sorted((TESTS / tests).rglob("test_*.py")):
        place = code / path.parent.relative_to(TESTS / tests)
        words = path.stem.removeprefix("test_").split("_")
        stems = ["_".join(words[:count]) for count in range(1, len(words) + 1)]
        is_there = any((place / f"{stem}.py").exists() or (place / stem).is_dir() for stem in stems)
        if not is_there and path.relative_to(TESTS).as_posix() != "benchmarks/test_imports.py":
            wrong.append(path.relative_to(TESTS).as_posix())
    assert not wrong


def test_tests_use_public_names() -> None:
    wrong = []
    for path in sorted(TESTS.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and node.attr.startswith("_") and node.attr[1:2].islower():
                is_own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
                if not is_own and node.attr not in NAMES_OF_OTHERS:
                    wrong.append(f"{path.relative_to(TESTS)}, line {node.lineno}: {ast.unparse(node)}")
    assert not wrong


def test_no_test_measures_speed() -> None:
    """Benchmarks do; a test that waits has a deadline by `time.monotonic`, which only ends a hang."""
    for path in sorted(TESTS.rglob("test_*.py")):
        text = path.read_text(encoding="utf-8")
        if path != Path(__file__):
            assert "process_time" not in text, path
            assert "perf_counter(" not in text.replace("def perf_counter(", ""), path


def test_decisions_have_context_decision_alternatives_and_status() -> None:
    folder = ROOT / "docs" / "decisions"
    if not folder.exists():
        pytest.skip("the documentation is not there (tests of the wheel)")
    listed = (folder / "README.md").read_text(encoding="utf-8").splitlines()
    for path in sorted(folder.glob("0*.md")):
        text = path.read_text(encoding="utf-8")
        missing = [part for part in DECISION if not any(f"{mark}{part}" in text for mark in ("**", "## "))]
        missing = [part for part in missing if f"\n{part}: " not in text]
        assert not missing, f"{path.name}: {', '.join(missing)}"
        number, title = text.splitlines()[0].removeprefix("# ").split(". ", 1)
        entry = f"- [{int(number):04}]({path.name}) {title}"
        found = [line.partition(" (replaced in part by ")[0] for line in listed]
        assert entry in found, f"list {path.name} with its title in {folder.name}/README.md: {entry}"
