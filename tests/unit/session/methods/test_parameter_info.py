"""Labels, help and defaults of the parameters of every method."""

import re

import pytest

from manytouch.session.methods import METHODS, parameter_info, parameters_of, pipeline_for
from manytouch.session.methods.parameter_info import ESSENTIAL, FURTHER, attribute_docs


def test_texts_of_attributes_are_joined_and_shared() -> None:
    docstring = """Title.

    More.

    Attributes:
        first, second: of two
            lines: here.
        third: alone.

    Raises:
        other: not an attribute.
    """
    import inspect

    texts = attribute_docs(inspect.cleandoc(docstring))
    assert texts == {"first": "Of two lines: here.", "second": "Of two lines: here.", "third": "Alone."}
    assert attribute_docs("Without attributes.") == {}


@pytest.mark.parametrize("method", METHODS)
def test_every_parameter_has_help_and_its_default(method: str) -> None:
    info = parameter_info(method)
    assert {name: each.default for name, each in info.items()} == parameters_of(pipeline_for(method))
    assert [name for name, each in info.items() if not each.help] == []
    essential = [name for name, each in info.items() if each.is_essential]
    assert len(essential) in (range(12, 13) if method == "paper" else range(5, 8))
    assert list(info)[: len(essential)] == essential


@pytest.mark.parametrize("method", METHODS)
def test_help_and_labels_are_for_readers_of_the_page(method: str) -> None:
    """No names of modules, no marks of code, no Python; whole sentences."""
    for name, each in parameter_info(method).items():
        assert not re.search(r"`|manytouch\.|None:", each.help), name
        assert re.search(r"[.?)]$", each.help), name
        if each.is_essential or name.startswith("interpolation."):
            assert "›" not in each.label, name


def test_every_essential_parameter_exists() -> None:
    known = {name for method in METHODS for name in parameter_info(method)}
    assert set(ESSENTIAL) | set(FURTHER) <= known


def test_what_the_paper_finds_by_trial_is_shown_first() -> None:
    info = parameter_info("paper")
    essential = {name for name, each in info.items() if each.is_essential}
    assert {"detect.kernel_px", "estimate.padding", *FURTHER} <= essential
    assert not parameter_info("mechanics")["interpolation.power"].is_essential
