"""The fuzzer detects crashes, hangs, reads outside of the folder, and executed code."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from tools.fuzz import cases
from tools.fuzz.cases import CRASH, FINE, HANG, OUTSIDE, RAN, REFUSED, attempt
from tools.fuzz.mutating import mutate
from tools.fuzz.seeds import MODEL, STUDY
from tools.fuzz.targets import TARGETS
from tools.fuzz.watching import Watch


@pytest.fixture(scope="module")
def watch() -> Watch:
    """The only watch: audit hooks cannot be removed."""
    return Watch()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder of a case beside a secret file."""
    (tmp_path / "secret.csv").write_text("1,2")
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "own.csv").write_text("1")
    return tmp_path / "case"


def _read(name: str) -> Callable[[Path], list[tuple[int, str]]]:
    def use(folder: Path) -> list[tuple[int, str]]:
        (folder / name).read_bytes()
        return [(0, "")]

    return use


def _run(folder: Path) -> list[tuple[int, str]]:
    subprocess.run([sys.executable, "-c", ""], check=True)
    return [(0, "")]


def _execute(folder: Path) -> list[tuple[int, str]]:
    exec("1 + 1", {"__name__": "unknown"})
    return [(0, "")]


def _fail(folder: Path) -> list[tuple[int, str]]:
    raise KeyError("x")


@pytest.mark.parametrize(
    ("use", "result"),
    [
        (_read("own.csv"), FINE),
        (lambda folder: [(0, ""), (2, "It is refused.")], REFUSED),
        (lambda folder: [(2, "Two\nlines.")], CRASH),
        (lambda folder: [(1, "")], CRASH),
        (_fail, CRASH),
        (_read("../secret.csv"), OUTSIDE),
        (_run, RAN),
        (_execute, RAN),
    ],
)
def test_a_case_has_the_result_of_its_commands(
    folder: Path,
    watch: Watch,
    use: Callable[[Path], list[tuple[int, str]]],
    result: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(TARGETS, "toy", use)
    assert attempt("toy", folder, watch).result == result


@pytest.mark.parametrize(
    ("durations", "result"), [((0.0, 0.15, 0.15), FINE), ((0.0, 0.25), HANG), ((0.25, 0.0), HANG)]
)
def test_the_cpu_time_of_each_command_is_limited(
    folder: Path,
    watch: Watch,
    durations: tuple[float, ...],
    result: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def compute(folder: Path) -> Iterator[tuple[int, str]]:
        for seconds in durations:
            now[0] += seconds
            yield 0, ""

    now = [5.0]
    monkeypatch.setattr(cases, "SECONDS", 0.2)
    monkeypatch.setattr(cases, "cpu_time", lambda: now[0])
    monkeypatch.setitem(TARGETS, "toy", compute)
    assert attempt("toy", folder, watch).result == result


def test_a_secret_that_another_process_read_is_detected(folder: Path, watch: Watch) -> None:
    watch.begin(folder)
    os.utime(folder.parent / "secret.csv", (2, 2))  # as if another process had read it
    watch.end()
    assert [Path(path).name for path in watch.outside] == ["secret.csv"]


@pytest.mark.parametrize(
    ("name", "text"), [("model.xml", MODEL), ("STUDY.yaml", STUDY), ("log.bag", MODEL)]
)
def test_the_same_seed_makes_the_same_file(name: str, text: str) -> None:
    def mutated(seed: int) -> bytes:
        return mutate(name, text.encode(), np.random.default_rng(seed))

    assert mutated(1) == mutated(1)
    assert len({mutated(seed) for seed in range(10)}) > 5
