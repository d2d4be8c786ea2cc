"""Effort residual: a pendulum whose torque or angle is measured with errors of no cause."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.inference.flexible_residual import banks
from reality_gap.inference.learned_residual import Learned, learn
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.types import Floats

MACHINE = """
<mujoco>
  <worldbody>
    <body>
      <joint name="hinge" axis="{axis}" damping="{damping}"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1.0"/>
    </body>
  </worldbody>
  <sensor><jointpos name="angle" joint="hinge"/></sensor>
</mujoco>
"""
PENDULUM = MACHINE.format(axis="0 1 0", damping=0.2)
TURNTABLE = MACHINE.format(axis="0 0 1", damping=20.0)
"""The same about a vertical axis: its torque depends on the velocity, and not on the position."""
TIME = np.arange(0.0, 20.0, 0.005)
ANGLE = 0.5 * np.sin(1.9 * TIME) + 0.3 * np.sin(3.1 * TIME + 1.0)
TORQUE_NOISE, ANGLE_NOISE = 0.01, 1e-5


def torque(machine: str, angle: Floats) -> Floats:
    """Return the torque of a machine along a motion (n,) [N m]."""
    model = mujoco.MjModel.from_xml_string(machine)
    data, found = mujoco.MjData(model), np.empty(len(angle))
    speed = np.gradient(angle, TIME)
    for k, row in enumerate(zip(angle, speed, np.gradient(speed, TIME), strict=True)):
        data.qpos[0], data.qvel[0], data.qacc[0] = row
        mujoco.mj_inverse(model, data)
        found[k] = data.qfrc_inverse[0]
    return found


def learned(
    folder: Path,
    angle_error: Floats,
    torque_error: Floats,
    machine: str = PENDULUM,
    jobs: int = 1,
) -> dict[str, Learned]:
    """Return what each bank explains of a log with these errors (n,)."""
    path = folder / "pendulum.xml"
    path.write_text(machine, encoding="utf-8")
    channels = (
        Channel("angle", "angle", unit="rad", noise=ANGLE_NOISE),
        Channel("torque", "hinge", unit="N m", noise=TORQUE_NOISE, kind="effort"),
    )
    rng = np.random.default_rng(0)
    angle = ANGLE + angle_error + ANGLE_NOISE * rng.standard_normal(len(TIME))
    effort = torque(machine, ANGLE) + torque_error + TORQUE_NOISE * rng.standard_normal(len(TIME))
    readings = (Reading(TIME, angle), Reading(TIME, effort))
    episode = Episode("swing", TIME, np.zeros((len(TIME), 0)), readings)
    with Replayer(Study("pendulum", path, channels, (episode,)), jobs) as replayer:
        residual = replayer.residual([])
        none = np.zeros((len(residual), 0))
        problem = Problem(replayer, residual, independent_noise(replayer.measured, none))
        records = replayer.replay([]).records
        return {bank.name: learn(problem, residual, bank) for bank in banks(replayer, [], records)}


def best(found: dict[str, Learned]) -> Learned:
    return max(found.values(), key=lambda one: one.evidence)


def test_nothing_is_learned_of_noise(tmp_path: Path) -> None:
    assert best(learned(tmp_path, 0.0 * TIME, 0.0 * TIME)).evidence < 5.0


@pytest.mark.parametrize("cycles", [6.0, 22.0])
def test_a_motor_that_cogs_is_found_by_its_position(tmp_path: Path, cycles: float) -> None:
    wave = 0.02 * np.sin(2 * np.pi * cycles * ANGLE / np.ptp(ANGLE))
    found = best(learned(tmp_path, 0.0 * TIME, wave))

    assert found.name == "position of hinge"
    assert found.evidence > 30.0
    assert found.explained > 0.3


def test_an_end_stop_is_found_by_its_position(tmp_path: Path) -> None:
    push = np.maximum(0.0, ANGLE - 0.6)
    found = best(learned(tmp_path, 0.0 * TIME, push))

    assert found.name == "position of hinge"
    assert found.evidence > 100.0


def test_an_encoder_that_drifts_is_found_by_the_time(tmp_path: Path) -> None:
    drift = 0.05 * (1.0 - np.exp(-TIME / 6.0))
    found = best(learned(tmp_path, drift, 0.0 * TIME))

    assert found.name == "position errors by the time"
    assert found.explained > 0.8


def test_a_drift_is_seen_by_its_velocity_where_the_position_does_not_matter(tmp_path: Path) -> None:
    drift = 0.05 * (1.0 - np.exp(-TIME / 6.0))
    tried = learned(tmp_path, drift, 0.0 * TIME, TURNTABLE)

    assert tried["position errors by the time"].evidence > 100.0


def test_processes_learn_the_same(tmp_path: Path) -> None:
    drift = 0.05 * (1.0 - np.exp(-TIME / 6.0))
    alone = learned(tmp_path, drift, 0.0 * TIME)
    shared = learned(tmp_path, drift, 0.0 * TIME, jobs=2)

    for name, one in alone.items():
        assert shared[name].evidence == pytest.approx(one.evidence, rel=1e-9)


def test_a_motion_of_a_small_share_of_the_range_has_banks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No joint counts as moving there, although its effort is compared."""
    monkeypatch.setattr("reality_gap.inference.motion_functions.STILL", 10.0)

    assert "position errors by the time" not in learned(tmp_path, 0.0 * TIME, 0.0 * TIME)
