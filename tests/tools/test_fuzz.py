"""The fuzzer sees what it is there to see."""

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
    """Hooks stay for good, so there is one."""
    return Watch()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An empty case beside a secret."""
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
    exec("1 + 1", {"__name__": "stranger"})
    return [(0, "")]


def _fail(folder: Path) -> list[tuple[int, str]]:
    raise KeyError("x")


@pytest.mark.parametrize(
    ("use", "what"),
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
def test_what_becomes_of_a_case(
    folder: Path,
    watch: Watch,
    use: Callable[[Path], list[tuple[int, str]]],
    what: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(TARGETS, "toy", use)
    assert attempt("toy", folder, watch).what == what


@pytest.mark.parametrize(
    ("longer", "what"), [((0.0, 0.15, 0.15), FINE), ((0.0, 0.25), HANG), ((0.25, 0.0), HANG)]
)
def test_each_command_has_its_own_time(
    folder: Path,
    watch: Watch,
    longer: tuple[float, ...],
    what: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def compute(folder: Path) -> Iterator[tuple[int, str]]:
        for seconds in longer:
            now[0] += seconds
            yield 0, ""

    now = [5.0]
    monkeypatch.setattr(cases, "SECONDS", 0.2)
    monkeypatch.setattr(cases, "computed", lambda: now[0])
    monkeypatch.setitem(TARGETS, "toy", compute)
    assert attempt("toy", folder, watch).what == what


def test_a_secret_that_was_read_by_another_process_is_noticed(folder: Path, watch: Watch) -> None:
    watch.begin(folder)
    os.utime(folder.parent / "secret.csv", (2, 2))  # as a reader of any language leaves it
    watch.end()
    assert [Path(path).name for path in watch.outside] == ["secret.csv"]


@pytest.mark.parametrize(
    ("name", "text"), [("model.xml", MODEL), ("STUDY.yaml", STUDY), ("log.bag", MODEL)]
)
def test_the_same_seed_makes_the_same_file(name: str, text: str) -> None:
    def made(seed: int) -> bytes:
        return mutate(name, text.encode(), np.random.default_rng(seed))

    assert made(1) == made(1)
    assert len({made(seed) for seed in range(10)}) > 5
