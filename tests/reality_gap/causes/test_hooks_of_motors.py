"""Hooks that change a motor's force, in pairs of models and commands that do the same."""

from __future__ import annotations

import math
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from reality_gap.causes.base import Hook
from reality_gap.causes.dead_zone import _DeadBand
from reality_gap.causes.support.elastic_gear import ElasticGear
from reality_gap.causes.support.force_lag import ForceLag
from reality_gap.types import Floats

STEP, LAG = 0.002, 0.03
MODEL = f"""<mujoco><option timestep="{STEP}" integrator="implicitfast"/><worldbody><body>
<joint name="j" axis="0 1 0" damping="0.3" armature="0.01"/>
<geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3" mass=".5"/></body></worldbody>
<actuator><general name="m" joint="j" gear="2" {{traits}}/></actuator>
</mujoco>"""
MOTOR = 'biastype="affine"'  # as replays make motors, whose bias MuJoCo ignores otherwise
SERVO = 'biastype="affine" gainprm="6" biasprm="0 -3 -.2"'


ACTING: dict[str, tuple[str, Callable[[mujoco.MjModel], Hook]]] = {
    "lag of a motor": (MOTOR, lambda model: ForceLag(model, ("m",), LAG)),
    "lag of a servo": (SERVO, lambda model: ForceLag(model, ("m",), LAG)),
    "dead zone of a servo": (SERVO, lambda model: _DeadBand(model, ("m",), 0.05)),
    "elastic gear of a motor": (MOTOR, lambda model: ElasticGear(model, "m", "j", 0.02, 1.0)),
    "elastic gear of a servo": (SERVO, lambda model: ElasticGear(model, "m", "j", 0.02, 1.0)),
}
"""Traits of an actuator, and a hook that acts on it."""


@pytest.fixture(params=list(ACTING))
def acting(request: pytest.FixtureRequest) -> str:
    """One of `ACTING`."""
    return str(request.param)


def moved(acting: str, traits: str, commands: Floats) -> Floats:
    """Positions of the joint (n,) [rad] with a hook, at commands (n,)."""
    bias, make = ACTING[acting]
    traits = f"{bias} {traits}"
    model = mujoco.MjModel.from_xml_string(MODEL.format(traits=traits))
    data = mujoco.MjData(model)
    hook, found = make(model), []
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


def test_a_command_beyond_its_range_is_one_at_its_limit(commands: Floats, acting: str) -> None:
    found = moved(acting, 'ctrllimited="true" ctrlrange="-.2 .4"', commands)
    np.testing.assert_allclose(found, moved(acting, "", commands.clip(-0.2, 0.4)), atol=1e-9)


def test_a_late_command_is_one_of_before(commands: Floats, acting: str) -> None:
    late = 12
    shifted = np.concatenate([np.zeros(late), commands[:-late]])
    delay = (late - 0.5) * STEP  # not on a sample, where rounding would decide
    found = moved(acting, f'delay="{delay}" nsample="{late + 1}"', commands)
    np.testing.assert_allclose(found, moved(acting, "", shifted), atol=1e-9)


def test_a_filtered_command_is_a_smoother_one(commands: Floats, acting: str) -> None:
    constant, filtered = 0.05, np.zeros(len(commands))
    for k in range(len(commands) - 1):
        share = 1.0 - math.exp(-STEP / constant)
        filtered[k + 1] = filtered[k] + share * (commands[k] - filtered[k])
    found = moved(acting, f'dyntype="filterexact" dynprm="{constant}"', commands)
    np.testing.assert_allclose(found, moved(acting, "", filtered), atol=1e-9)
