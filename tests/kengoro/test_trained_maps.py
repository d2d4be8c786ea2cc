"""Maps trained on the nominal model of Kengoro's arm, against MuJoCo."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.mapping.training import load_or_train
from kengoro.trained_maps import nominal_model
from kengoro_env.assets import asset_path
from kengoro_env.robot.nominal_model import NominalArm


def postures_inside(of, count, seed=7):
    return np.random.default_rng(seed).uniform(of.lower, of.upper, (count, len(of.joints)))


def rms(array):
    return float(np.sqrt(np.square(array).mean()))


def test_the_arms_groups_are_the_papers():
    sizes = {g.name: (g.joint_index.size, g.muscle_index.size) for g in nominal_model().topology()}
    assert sizes == {"neck": (3, 8), "scapula": (4, 10), "shoulder": (8, 10), "forearm": (3, 8)}


@pytest.mark.slow
def test_the_arm_is_learnt_to_a_tenth_of_a_millimetre_and_its_jacobians_are_mujocos(tmp_path):
    """One test, as several processes of a run would each train the map for theirs."""
    source = NominalArm(asset_path("mjcf/kengoro_arm/arm.xml"))
    jmm, _ = load_or_train(nominal_model(), 0, tmp_path)
    q = postures_inside(nominal_model(), 2000)
    error = jmm.lengths(q) - source.lengths(q)
    for group in jmm.groups:
        assert rms(error[:, group.muscle_index]) < 1e-4, group.name
    true = np.array([source.moment_arms(posture) for posture in q[:200]])
    assert rms(true) > 0.01
    assert rms(jmm.jacobian(q[:200]) - true) < 1e-3
    assert rms(jmm.jacobian_quadratic(q[:200]) - true) < 1.5e-3
