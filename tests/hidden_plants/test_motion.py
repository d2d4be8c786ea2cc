"""Motions are informative, start at rest, keep all tendons taut and avoid the joint limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hidden_plants import Secret, Truth, write_study
from hidden_plants.machine import BIAS, CUT, Machine, load

ASSETS = Path(__file__).parents[2] / "assets" / "mjcf" / "kengoro_arm"
SECONDS = {"elbow": 20.0, "arm": 5.0}


@pytest.fixture(scope="module", params=["elbow", "arm"])
def simulated(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Machine, Truth]:
    name, folder = request.param, tmp_path_factory.mktemp("study")
    truth = write_study(folder, Secret(motion=1), 2, name, ASSETS, SECONDS[name])
    return load(name, ASSETS), truth


def test_episodes_have_the_requested_duration(simulated: tuple[Machine, Truth]) -> None:
    _, truth = simulated
    assert sum(episode.duration for episode in truth.episodes) == SECONDS[truth.machine]
    starts = np.cumsum([0.0, *(episode.duration for episode in truth.episodes)])[:-1]
    assert [episode.start for episode in truth.episodes] == list(starts)


@pytest.mark.parametrize("name", SECONDS)
def test_a_machine_needs_no_file_of_what_is_only_seen(name: str) -> None:
    machine = load(name, ASSETS)
    assert machine.model.nmesh == machine.model.ntex == 0
    assert "file=" not in machine.xml


def test_no_joint_comes_near_its_limit(simulated: tuple[Machine, Truth]) -> None:
    machine, truth = simulated
    low, high = machine.model.jnt_range.T
    for episode in truth.episodes:
        assert (episode.qpos > low + np.deg2rad(4.0)).all()
        assert (episode.qpos < high - np.deg2rad(4.0)).all()


def test_all_tendons_stay_taut(simulated: tuple[Machine, Truth]) -> None:
    machine, truth = simulated
    for episode in truth.episodes:
        tensions = np.array([episode.clean[f"tension_{tendon}"] for tendon in machine.tendons])
        assert tensions.min() > BIAS - 1.0
        assert np.median(tensions) > 60.0
        assert tensions.max() < CUT


def test_every_episode_starts_at_rest(simulated: tuple[Machine, Truth]) -> None:
    _, truth = simulated
    for episode in truth.episodes:
        speed = (episode.qpos[1] - episode.qpos[0]) / 0.02
        assert np.abs(speed).max() < 0.3


@pytest.mark.parametrize("simulated", ["elbow"], indirect=True)
def test_the_elbow_turns_far_and_fast_in_both_directions(simulated: tuple[Machine, Truth]) -> None:
    _, truth = simulated
    angle = np.concatenate([episode.qpos[:, 0] for episode in truth.episodes])
    speed = np.concatenate([np.gradient(e.qpos[:, 0], e.sensor_time) for e in truth.episodes])
    assert np.rad2deg(angle.min()) < 25.0
    assert np.rad2deg(angle.max()) > 95.0
    assert speed.max() > 2.0
    assert speed.min() < -2.0
    assert (np.abs(speed) < 0.05).mean() > 0.05
