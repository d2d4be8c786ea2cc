"""Control periods: physics divides each evenly, and a period that it divides already stays."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import kengoro_env
from kengoro_env.assets import asset_path
from kengoro_env.robot.control_period import set_time_step
from kengoro_env.vector import KengoroVectorEnv

ELBOW = asset_path("mjcf/kengoro_arm/elbow.xml")


@pytest.mark.parametrize("period", [0.002, 0.02, 0.03, 0.05])
def test_a_time_step_that_divides_the_period_stays(period: float) -> None:
    spec = mujoco.MjSpec.from_file(str(ELBOW))
    assert set_time_step(spec, period) == round(period / 0.002)
    assert spec.option.timestep == 0.002


@pytest.mark.parametrize(("period", "substeps"), [(0.005, 3), (0.001, 1), (0.003, 2), (1 / 60, 9)])
def test_another_time_step_is_shortened_until_it_divides_the_period(
    period: float, substeps: int
) -> None:
    spec = mujoco.MjSpec.from_file(str(ELBOW))
    assert set_time_step(spec, period) == substeps
    assert spec.option.timestep <= 0.002
    assert substeps * spec.option.timestep == pytest.approx(period, rel=1e-12)


@pytest.mark.parametrize("period", [0.005, 0.05])
def test_one_environment_and_many_step_by_the_same_period(period: float) -> None:
    one = kengoro_env.KengoroEnv("elbow", 3, control_period=period)
    many = KengoroVectorEnv(2, "elbow", 3, control_period=period)
    one.reset(seed=5)
    many.reset(seed=5)
    action = np.zeros(one.action_space.shape, np.float32)
    for _ in range(20):
        observation, *_, info = one.step(action)
        observations, *_, infos = many.step(np.stack([action, action]))
    assert info["time"] == pytest.approx(20 * period)
    assert infos["time"][0] == info["time"]
    np.testing.assert_array_equal(observations["lengths"][0], observation["lengths"])
    assert one.metadata["render_fps"] == many.metadata["render_fps"] == round(1 / period)
    one.close()
    many.close()
