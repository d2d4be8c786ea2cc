"""`python -m benchmarks` lists and runs benchmarks; an unknown name is an error with the list."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import __main__ as benchmarks


@pytest.fixture
def two_benchmarks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with two benchmarks and a helper module in place of the real ones."""
    for name in ("toy_one", "toy_two", "_helper"):
        (tmp_path / f"{name}.py").write_text(
            f'"""Measurement of {name}.\n\nMore."""\n\ndef main():\n    print("{name} ran")\n'
        )
    monkeypatch.setattr(benchmarks, "FOLDER", tmp_path)
    monkeypatch.setattr("benchmarks.__path__", [str(tmp_path)])


@pytest.mark.usefixtures("two_benchmarks")
@pytest.mark.parametrize("arguments", [[], ["--help"], ["toy_one", "-h"]])
def test_benchmarks_are_listed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert benchmarks.main(arguments) == 0
    usage, empty, *listed = capsys.readouterr().out.splitlines()
    assert (usage, empty) == ("usage: python -m benchmarks NAME [NAME ...]", "")
    lines = [line.split(maxsplit=1) for line in listed]
    assert lines == [["toy_one", "Measurement of toy_one."], ["toy_two", "Measurement of toy_two."]]


@pytest.mark.usefixtures("two_benchmarks")
def test_benchmarks_run_in_the_given_order(capsys: pytest.CaptureFixture[str]) -> None:
    assert benchmarks.main(["toy_two", "toy_one"]) == 0
    assert capsys.readouterr().out == "toy_two ran\ntoy_one ran\n"


@pytest.mark.usefixtures("two_benchmarks")
@pytest.mark.parametrize("name", ["toy_three", "_helper", "__main__", "os"])
def test_an_unknown_name_is_an_error_that_lists_the_benchmarks(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert benchmarks.main(["toy_one", name]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"There is no benchmark {name!r}; there are: toy_one, toy_two.\n"
