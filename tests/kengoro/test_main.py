"""The console script `kengoro`."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest

import kengoro
from kengoro.__main__ import COMMANDS, main
from reality_gap import load_study


def test_without_a_command_it_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    output = capsys.readouterr().out
    assert all(f"  {name} " in output for name in COMMANDS)
    assert main(["--help"]) == 0


def test_it_prints_its_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"kengoro {version('kengoro')}\n"


def test_an_unknown_command_is_refused_with_the_known_ones(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["dance"]) == 2
    assert "no command 'dance'; there are: demo, record, view" in capsys.readouterr().err


def test_a_wrong_value_is_one_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["record", "--out", str(tmp_path / "log"), "--move", "0"]) == 2
    assert capsys.readouterr().err == "move is 0 s, but it must be above 0 and finite.\n"
    assert not (tmp_path / "log").exists()


def test_in_a_checkout_it_lists_the_experiments(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["experiments"]) == 0
    assert "can-grasping" in capsys.readouterr().out


def test_outside_of_a_checkout_it_names_the_repository(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kengoro.__main__.find_spec", lambda name: None)
    assert main(["experiments"]) == 2
    assert "in the repository" in capsys.readouterr().err


def test_record_writes_a_study_that_can_be_loaded(tmp_path: Path) -> None:
    path = kengoro.record(tmp_path, robot=1, arm="elbow", duration=4.0)
    assert path == tmp_path / "STUDY.yaml"
    [episode] = load_study(path).episodes
    assert episode.duration == pytest.approx(5.0, abs=0.1)  # whole visits


def test_record_refuses_an_arm_that_it_does_not_know(tmp_path: Path) -> None:
    with pytest.raises(kengoro.UsageError, match="must be one of: whole, elbow"):
        kengoro.record(tmp_path, arm="leg")  # type: ignore[arg-type]
