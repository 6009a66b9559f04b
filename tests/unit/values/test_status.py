"""Every status that needs attention has a remedy."""

from manytouch.values import Status


def test_each_status_has_one_sentence_of_remedy() -> None:
    assert Status.OK.remedy == ""
    for status in set(Status) - {Status.OK}:
        assert status.remedy.endswith(".")
        assert 20 < len(status.remedy) < 120


def test_a_status_is_written_as_its_word() -> None:
    assert f"{Status.FEW_MARKERS}" == str(Status.FEW_MARKERS) == "few_markers"
    assert Status("few_markers") is Status.FEW_MARKERS
