"""Some hostile inputs of each kind; `make faults` tries 10 000."""

import time
from collections.abc import Iterator

import pytest

from faults import runner
from faults.fuzzers import FUZZERS, bombs
from faults.runner import WRONG, Worker, run_all, table

EACH = 20
FIRST_SEED = 1_000_014  # others than those of `make faults`; of each kind one that is accepted


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    worker = Worker("faults.fuzzers")
    yield worker
    worker.close()


def test_damaged_inputs_are_accepted_or_refused_with_a_sentence(worker: Worker) -> None:
    names = [fuzzer.name for fuzzer in FUZZERS if fuzzer.name != "bomb"]
    outcomes = list(run_all("faults.fuzzers", names, range(FIRST_SEED, FIRST_SEED + EACH), worker=worker))
    wrong = [each for each in outcomes if each.kind == WRONG]
    assert not wrong, "\n".join(f"{each.fuzzer}, seed {each.seed}: {each.text}" for each in wrong)
    refused = {each.fuzzer for each in outcomes if each.kind == "refused"}
    accepted = {each.fuzzer for each in outcomes if each.kind == "ok"}
    assert refused >= {"sensor file", "scene", "press table", "image", "video", "board"}
    assert accepted == set(names), table(outcomes)


def test_bombs_are_refused_within_seconds_and_200_mb(worker: Worker) -> None:
    outcomes = list(run_all("faults.fuzzers", ["bomb"], range(len(bombs())), worker=worker))
    kinds = {list(bombs())[each.seed]: (each.kind, each.text) for each in outcomes}
    assert {kind for kind, _ in kinds.values()} == {"refused"}, kinds


def test_the_runner_finds_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "TIMEOUT_S", 1.0)
    names = ["crash", "memory", "no sentence", "dies", "hang", "fine"]  # each new process takes a second
    found = {each.fuzzer: each for each in run_all("faults.examples", names, [0])}
    assert found.pop("fine").kind == "ok"
    assert {each.kind for each in found.values()} == {WRONG}
    assert "ZeroDivisionError" in found["crash"].text
    assert "no result within" in found["hang"].text
    assert "MemoryError" in found["memory"].text
    assert "died" in found["dies"].text
    assert "no sentence" in found["no sentence"].text


def test_time_in_which_a_process_waits_for_a_processor_does_not_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(runner, "TIMEOUT_S", 0.3)
    monkeypatch.setattr(runner, "POLL_S", 0.05)
    worker = Worker("faults.examples")
    assert worker.run("slow", 0).kind == WRONG
    monkeypatch.setattr(runner, "waiting_s", lambda _: 0.8 * time.monotonic())
    assert worker.run("slow", 0).kind == "ok"
    assert worker.run("hang", 0).kind == WRONG
    worker.close()
