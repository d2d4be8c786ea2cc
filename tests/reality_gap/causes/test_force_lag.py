"""Lag of a motor's force, in pairs of models and commands that do the same."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from reality_gap.causes.support.force_lag import ForceLag
from reality_gap.types import Floats

STEP, LAG = 0.002, 0.03
MODEL = f"""<mujoco><option timestep="{STEP}" integrator="implicitfast"/><worldbody><body>
<joint name="j" axis="0 1 0" damping="0.3"/><geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3"
mass=".5"/></body></worldbody><actuator><general name="m" joint="j" gear="2" {{traits}}/></actuator>
</mujoco>"""
MOTOR = 'biastype="affine"'  # as replays make motors, whose bias MuJoCo ignores otherwise
SERVO = 'biastype="affine" gainprm="6" biasprm="0 -3 -.2"'


def moved(traits: str, commands: Floats) -> Floats:
    """Positions of the joint (n,) [rad] with a lag of the force, at commands (n,)."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(traits=traits))
    data = mujoco.MjData(model)
    hook, found = ForceLag(model, ("m",), LAG), []
    if model.actuator_history[0, 0]:
        past = STEP * np.arange(-int(model.actuator_history[0, 0]), 0)
        mujoco.mj_initCtrlHistory(model, data, 0, past, np.zeros(len(past)))
    for command in commands:
        data.ctrl[0] = command
        hook(model, data)
        mujoco.mj_step(model, data)
        found.append(float(data.qpos[0]))
    return np.array(found)


@pytest.fixture
def commands() -> Floats:
    time = STEP * np.arange(1500)
    return np.asarray(0.5 * np.sin(5.0 * time) + 0.3 * (time > 1.0), dtype=np.float64)


@pytest.mark.parametrize("bias", [MOTOR, SERVO], ids=["motor", "servo"])
def test_a_command_beyond_its_range_is_one_at_its_limit(commands: Floats, bias: str) -> None:
    found = moved(f'{bias} ctrllimited="true" ctrlrange="-.2 .4"', commands)
    np.testing.assert_allclose(found, moved(bias, commands.clip(-0.2, 0.4)), atol=1e-9)


@pytest.mark.parametrize("bias", [MOTOR, SERVO], ids=["motor", "servo"])
def test_a_late_command_is_one_of_before(commands: Floats, bias: str) -> None:
    late = 12
    shifted = np.concatenate([np.zeros(late), commands[:-late]])
    delay = (late - 0.5) * STEP  # not on a sample, where rounding would decide
    found = moved(f'{bias} delay="{delay}" nsample="{late + 1}"', commands)
    np.testing.assert_allclose(found, moved(bias, shifted), atol=1e-9)


@pytest.mark.parametrize("bias", [MOTOR, SERVO], ids=["motor", "servo"])
def test_a_filtered_command_is_a_smoother_one(commands: Floats, bias: str) -> None:
    constant, filtered = 0.05, np.zeros(len(commands))
    for k in range(len(commands) - 1):
        share = 1.0 - math.exp(-STEP / constant)
        filtered[k + 1] = filtered[k] + share * (commands[k] - filtered[k])
    found = moved(f'{bias} dyntype="filterexact" dynprm="{constant}"', commands)
    np.testing.assert_allclose(found, moved(bias, filtered), atol=1e-9)
