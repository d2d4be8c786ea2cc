"""An agent continues from a file to the bit, and names a zeroing that was not announced."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import CheckpointError, JointMuscleMap
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.hold_out import HoldOutOptions
from tests.jmm_agent.nominal_arm import posture_set
from tests.jmm_agent.test_agent import Trial

POSTURES = posture_set()[:10]


@pytest.mark.parametrize("hold_out", [None, HoldOutOptions(every=2)])
def test_an_agent_continues_to_the_bit(
    nominal_map: JointMuscleMap,
    arm: ArmKinematics,
    tmp_path: Path,
    hold_out: HoldOutOptions | None,
) -> None:
    options = VisionOptions(hold_out=hold_out)
    one, other = (Trial(nominal_map, arm, seed=seed, vision=options) for seed in (0, 1))
    one.visit(*POSTURES[:3])
    one.agent.save(tmp_path / "learned.npz")
    one.agent.begin_episode()
    other.agent.load(tmp_path / "learned.npz")
    other.steps = one.steps
    for trial in (one, other):
        trial.visit(*POSTURES[3:5])
    assert other.same_map(one.agent.map)
    np.testing.assert_array_equal(other.agent.joint_angles, one.agent.joint_angles)
    assert other.agent.memory.generator == one.agent.memory.generator


def test_what_the_papers_rule_learned_is_loaded_to_the_bit(
    nominal_map: JointMuscleMap, arm: ArmKinematics, tmp_path: Path
) -> None:
    one, other = (Trial(nominal_map, arm, seed=seed, rule=MinibatchRule()) for seed in (0, 1))
    one.visit(POSTURES[1])
    for before, after in zip(nominal_map.groups, one.agent.map.groups, strict=True):
        assert np.abs(before.W1 - after.W1).max() > 0.0
        assert np.abs(before.b1 - after.b1).max() > 0.0
    one.agent.save(tmp_path / "learned.npz")
    one.agent.begin_episode()
    other.agent.load(tmp_path / "learned.npz")
    assert other.same_map(one.agent.map)
    other.steps = one.steps
    for trial in (one, other):
        trial.visit(POSTURES[3])
    assert other.same_map(one.agent.map)
    one.agent.close()


def test_a_failed_load_changes_nothing(
    nominal_map: JointMuscleMap, arm: ArmKinematics, tmp_path: Path
) -> None:
    trial = Trial(nominal_map, arm)
    trial.visit(POSTURES[1])
    before = trial.agent.memory
    path = tmp_path / "learned.npz"
    trial.agent.save(path)
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(CheckpointError, match="cut off or damaged"):
        trial.agent.load(path)
    after = trial.agent.memory
    assert after.map is before.map
    assert after.vision is not None
    assert after.vision.observations == before.vision.observations
    assert after.generator == before.generator


class Shifted:
    """Lengths of the nominal map, shifted at the posture of a trial."""

    def __init__(self, trial: Trial, nominal_map: JointMuscleMap, offsets: np.ndarray) -> None:
        self._trial, self._map, self._offsets = trial, nominal_map, offsets

    def lengths(self, q: np.ndarray) -> np.ndarray:
        own = self._map.lengths(q)
        return own + self._offsets if q is self._trial.q else own


def test_an_unannounced_zeroing_is_named(
    nominal_map: JointMuscleMap, arm: ArmKinematics, tmp_path: Path
) -> None:
    trial = Trial(nominal_map, arm)
    trial.visit(*POSTURES[1:7])
    trial.agent.save(tmp_path / "learned.npz")
    kinds = []
    for shift in (0.0, 0.012):
        after = Trial(nominal_map, arm)
        after.agent.load(tmp_path / "learned.npz")
        offsets = shift * np.random.default_rng(3).standard_normal(36)
        after._nominal_map = Shifted(after, nominal_map, offsets)  # type: ignore[assignment]
        after.visit(POSTURES[8])
        kinds.append([fault.kind for fault in after.agent.faults])
        assert after.agent.vision.fired == 1
    assert kinds == [[], ["zeroed"]]


@pytest.mark.parametrize(("fit", "size"), [("together", 0.004), ("rests", 0.0046)])
def test_lengths_that_were_zeroed_at_another_posture_are_named(
    nominal_map: JointMuscleMap,
    arm: ArmKinematics,
    tmp_path: Path,
    fit: Literal["together", "rests"],
    size: float,
) -> None:
    """``size`` [m] RMS, which are too little to be noticed if they were independent shifts."""
    vision = VisionOptions(fit=fit)
    trial = Trial(nominal_map, arm, vision=vision)
    trial.visit(*POSTURES[1:8])
    trial.agent.save(tmp_path / "learned.npz")
    turn = np.random.default_rng(0).standard_normal(14)
    offsets = nominal_map.jacobian(np.zeros(14)) @ turn
    offsets *= size / np.sqrt(np.mean(offsets**2))
    named = []
    for shift in (offsets, np.random.default_rng(1).permutation(offsets)):
        after = Trial(nominal_map, arm, vision=vision)
        after.agent.load(tmp_path / "learned.npz")
        after._nominal_map = Shifted(after, nominal_map, shift)  # type: ignore[assignment]
        after.visit(POSTURES[8])
        named.append([fault.kind for fault in after.agent.faults])
        pairs = after.agent.antagonism.pairs
        assert (len(pairs.noise) == 0) == bool(named[-1])  # those of before are forgotten
    assert named == [["zeroed"], []]


def test_an_announced_zeroing_opens_all_offsets(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    trial.visit(*POSTURES[1:3])
    jmm = trial.agent.map
    trial.agent.zeroed()
    assert trial.agent.map is jmm
    assert (trial.agent.vision.elongated > 0.0).all()
    assert trial.agent.antagonism.memory.last is None
    assert trial.agent.faults == []


@pytest.mark.parametrize(("path", "why"), [(None, "got None"), (".", "is a folder"), (3, "got 3")])
def test_what_is_no_path_of_a_file_is_refused_in_a_sentence(
    nominal_map: JointMuscleMap, arm: ArmKinematics, path: Any, why: str
) -> None:
    agent = Trial(nominal_map, arm).agent
    with pytest.raises(CheckpointError, match=why):
        agent.save(path)
    with pytest.raises(CheckpointError, match=why):
        agent.load(path)
