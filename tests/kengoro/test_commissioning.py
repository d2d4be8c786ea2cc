"""Commissioning runs of Kengoro's arm in a session and from the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from jmm_agent.commissioning.commissioning import Commissioning
from kengoro.agents import make_agent
from kengoro.commands.commission import Args, main
from kengoro.commissioning import commission
from kengoro.errors import UsageError
from kengoro.robots import NO_END, make_env, shuffled_postures
from kengoro.session import Session
from kengoro_env.env import KengoroEnv

SEED = 2
PAIR = ("biceps", "delt_mid")


class SwappedEnv(gym.Wrapper[Any, Any, Any, Any]):
    """Two channels of the robot are exchanged, in commands and readings."""

    def __init__(self, env: gym.Env[Any, Any], pair: tuple[str, str]) -> None:
        super().__init__(env)
        assert isinstance(env.unwrapped, KengoroEnv)
        self._world = env.unwrapped
        self._order = np.arange(len(self._world.muscles))
        one, other = (self._world.muscles.index(name) for name in pair)
        self._order[[one, other]] = other, one

    def _read(self, observation: dict[str, Any]) -> dict[str, Any]:
        for name in ("lengths", "tensions"):
            observation[name] = observation[name][self._order]
        return observation

    def reset(self, **more: Any) -> Any:
        observation, info = self.env.reset(**more)
        return self._read(observation), info

    def step(self, action: Any) -> Any:
        lengths = self._world.action_to_lengths(action)[self._order]
        observation, *rest = self.env.step(self._world.lengths_to_action(lengths))
        return self._read(observation), *rest


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


def session(maps: Path, swapped: bool, commissioning: Commissioning | None = None) -> Session:
    env: Any = make_env("Posture", SEED, max_episode_steps=NO_END)
    if swapped:
        env = SwappedEnv(env, PAIR)
    start = shuffled_postures(SEED)[0]
    agent = make_agent(SEED, cache=maps, commissioning=commissioning)
    return Session(env, agent, SEED, options={"posture": start, "target": start})


@pytest.fixture(scope="module")
def result(maps: Path) -> Commissioning:
    return commission(session(maps, swapped=True))


def test_exchanged_muscles_of_an_actual_robot_are_named(result: Commissioning) -> None:
    assert [(each.kind, set(each.muscles)) for each in result.findings] == [("swapped", set(PAIR))]
    assert result.seconds < 75.0
    assert result.largest_tension < 300.0


def test_an_agent_with_the_result_moves_as_if_nothing_was_exchanged(
    result: Commissioning, maps: Path
) -> None:
    robots = [session(maps, swapped=False), session(maps, swapped=True, commissioning=result)]
    assert robots[1].agent.order is not None
    for robot in robots:
        robot.move(shuffled_postures(SEED)[1], duration=1.0)
    first, second = (robot.truth["joint_angles"] for robot in robots)
    assert np.allclose(first, second, atol=1e-6)


def test_an_absent_muscle_is_left_out_of_the_agent(maps: Path) -> None:
    robot = session(maps, swapped=False)
    robot.world.robot.elongate("biceps", 10.0)
    found = commission(robot)
    assert [(each.kind, each.muscles) for each in found.findings] == [("absent", ("biceps",))]
    agent = make_agent(SEED, guard=True, cache=maps, commissioning=found)
    assert "biceps" not in agent.map.muscles
    assert len(agent.map.muscles) == 35
    agent.go(shuffled_postures(SEED)[1], 1.0)
    command = agent.step(robot.readings)
    assert command.shape == (36,)
    assert np.isfinite(command).all()
    assert agent.faults == []


def test_the_command_prints_and_draws_what_was_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(Args(out=tmp_path / "new" / "pulls.png", robot=SEED))
    output = capsys.readouterr().out
    assert "no fault found" in output
    assert (tmp_path / "new" / "pulls.png").stat().st_size > 20_000


def test_options_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="together"):
        main(Args(out=tmp_path / "pulls.png", stiffness=100.0))
    with pytest.raises(UsageError, match="give --port"):
        main(Args(out=tmp_path / "x.png", scene=Path("examples/arm3.xml")))
