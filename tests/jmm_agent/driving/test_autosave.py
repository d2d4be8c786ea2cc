"""A file that holds what an agent has learned, while it drives."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.driving import autosave
from jmm_agent.driving.autosave import Autosave, AutosaveError
from jmm_agent.errors import AgentError
from tests.jmm_agent.driving.robots import EchoAgent, Robot, driven


class LearningAgent(EchoAgent):
    """Learns in some control periods; its memory is the number of the period."""

    def __init__(self, learns: tuple[int, ...]) -> None:
        super().__init__()
        self.steps, self._learns = 0, learns
        self.map, self.nominal_map = object(), object()
        self.vision = SimpleNamespace(memory=object())
        self.memory = 0

    def step(self, readings: Any) -> np.ndarray:
        self.steps += 1
        if self.steps in self._learns:
            self.map, self.memory = object(), self.steps
        return super().step(readings)


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    found = list[int]()
    monkeypatch.setattr(
        autosave, "write_memory", lambda path, memory, nominal: found.append(memory)
    )
    return found


def test_what_was_learned_is_written_when_a_drive_returns(written: list[int]) -> None:
    driven(LearningAgent((3, 6)), Robot(), memory="memory.npz")
    assert written[-1] == 6


def test_nothing_is_written_where_nothing_was_learned(written: list[int]) -> None:
    driven(LearningAgent(()), Robot(), memory="memory.npz")
    assert written == []


def test_it_is_written_before_an_error_ends_the_drive(written: list[int]) -> None:
    agent, robot = LearningAgent((3,)), Robot()
    agent.raises_at = 1000.07
    with pytest.raises(ValueError, match="lengths"):
        driven(agent, robot, memory="memory.npz")
    assert (written, robot.stopped) == ([3], 1)


def test_a_file_that_cannot_be_written_ends_the_drive_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def full(path: object, memory: object, nominal: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(autosave, "write_memory", full)
    robot, path = Robot(), tmp_path / "memory.npz"
    with pytest.raises(AutosaveError, match=r"memory\.npz .*No space left"):
        driven(LearningAgent((1,)), robot, 100.0, memory=path)
    assert robot.stopped == 1


def test_a_last_write_that_fails_stops_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: object, memory: object, nominal: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(autosave, "write_memory", full)
    robot = Robot()
    with pytest.raises(AutosaveError, match="No space left"):
        driven(LearningAgent((6,)), robot, memory="memory.npz")
    assert robot.stopped == 1


def test_the_last_write_is_waited_for(written: list[int]) -> None:
    agent = LearningAgent((1,))
    with Autosave(cast(Agent, agent), "memory.npz") as saving:
        agent.step(SimpleNamespace(time=0.0, lengths=np.zeros(2)))
        assert saving.written is None
        saving.step()
    assert written == [1]
    assert cast(object, saving.written) == 1


def test_a_folder_that_does_not_exist_is_named_with_the_whole_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    with Autosave(cast(Agent, LearningAgent(())), "usb/memory.npz"):
        pass
    [record] = caplog.records
    assert str(tmp_path / "usb" / "memory.npz") in record.getMessage()
    assert f"the folder {tmp_path / 'usb'} does not exist" in record.getMessage()


def test_what_is_no_path_of_a_file_stops_the_robot_before_it_moves(tmp_path: Path) -> None:
    for memory, why in ((5, "must be a str or a Path, got 5"), (tmp_path, "is a folder")):
        robot = Robot()
        with pytest.raises(AgentError, match=why):
            driven(LearningAgent((3,)), robot, memory=memory)
        assert (robot.commands, robot.stopped) == ([], 1)
