"""Some hostile inputs of each kind; `make faults` tries 10 000."""

from faults.fuzzers import FUZZERS, bombs
from faults.runner import WRONG, run_all, table

EACH = 40
FIRST_SEED = 1_000_000  # others than those of `make faults`


def test_damaged_inputs_are_accepted_or_refused_with_a_sentence() -> None:
    names = [fuzzer.name for fuzzer in FUZZERS if fuzzer.name != "bomb"]
    outcomes = list(run_all("faults.fuzzers", names, range(FIRST_SEED, FIRST_SEED + EACH)))
    wrong = [each for each in outcomes if each.kind == WRONG]
    assert not wrong, "\n".join(f"{each.fuzzer}, seed {each.seed}: {each.text}" for each in wrong)
    refused = {each.fuzzer for each in outcomes if each.kind == "refused"}
    accepted = {each.fuzzer for each in outcomes if each.kind == "ok"}
    assert refused >= {"sensor file", "scene", "press table", "image", "video", "board"}
    assert accepted == set(names), table(outcomes)


def test_bombs_are_refused_within_seconds_and_200_mb() -> None:
    outcomes = list(run_all("faults.fuzzers", ["bomb"], range(len(bombs()))))
    kinds = {bombs()[each.seed][0]: (each.kind, each.text) for each in outcomes}
    assert {kind for kind, _ in kinds.values()} == {"refused"}, kinds


def test_the_runner_finds_faults() -> None:
    names = ["crash", "hang", "memory", "dies", "no sentence"]
    found = {each.fuzzer: each for each in run_all("faults.examples", names, [0])}
    assert {each.kind for each in found.values()} == {WRONG}
    assert "ZeroDivisionError" in found["crash"].text
    assert "no result within" in found["hang"].text
    assert "MemoryError" in found["memory"].text
    assert "died" in found["dies"].text
    assert "no sentence" in found["no sentence"].text
    (fine,) = run_all("faults.examples", ["fine"], [0])
    assert fine.kind == "ok"
