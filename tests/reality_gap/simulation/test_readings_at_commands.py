"""Readings at the times of commands: positions and velocities are those then, forces those before.

A control loop reads its sensors, and then commands. Loops of reinforcement learning often command
at each physics step, or at every few.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Location
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.types import Floats

STEP, COUNT = 0.01, 200
ARM = f"""
<mujoco>
  <option timestep="{STEP}"/>
  <worldbody>
    <body>
      <joint name="hinge" axis="0 1 0" damping="0.1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.5"/>
      <site name="tip" pos="0.3 0 0"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="hinge"/></actuator>
  <sensor>
    <jointpos name="angle" joint="hinge"/>
    <jointvel name="speed" joint="hinge"/>
    <framequat name="orientation" objtype="site" objname="tip"/>
    <actuatorfrc name="torque" actuator="motor"/>
  </sensor>
</mujoco>
"""
CHANNELS = (
    Channel("angle", "angle", unit="rad", noise=1e-4),
    Channel("speed", "speed", unit="rad/s", noise=1e-3),
    Channel("turn", "orientation", 2, unit="1", noise=1e-4),
    Channel("torque", "torque", unit="N m", noise=1e-4),
)


def loop(every: int) -> tuple[Floats, Floats, Floats]:
    """Read, then command, at every few steps; return times (n,), commands (n, 1), readings (n, 4).

    The torque that is read is that of the step before, as it has its sensor.
    """
    model = mujoco.MjModel.from_xml_string(ARM)
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    time, command = every * STEP * np.arange(COUNT), rng.uniform(-1.0, 1.0, (COUNT, 1))
    readings = np.zeros((COUNT, 4))
    for k in range(COUNT):
        torque = data.actuator_force[0]
        mujoco.mj_forward(model, data)
        readings[k] = *data.sensordata[[0, 1, 4]], torque
        data.ctrl[:] = command[k]
        mujoco.mj_step(model, data, every)
    return time, command, readings


def study_of(path: Path, time: Floats, command: Floats, values: Floats) -> Study:
    """Study of readings (n, 4) at the times (n,) of commands (n, 1)."""
    readings = tuple(Reading(time, values[:, c]) for c in range(4))
    episode = Episode("loop", time, command, readings)
    return Study("arm", path, CHANNELS, (episode,), Initial(settle=0.0))


@pytest.mark.parametrize("every", [1, 2, 5])
def test_they_are_those_of_a_simulation_with_the_same_step(tmp_path: Path, every: int) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    replayer = Replayer(study_of(path, *loop(every)), step=1.0)

    error = replayer.measured.value - replayer.replay([]).prediction

    later = replayer.measured.time > 0.0  # no command was before the first readings
    assert np.std(replayer.measured.value) > 0.3
    np.testing.assert_allclose(error[later], 0.0, atol=1e-9)


@pytest.mark.parametrize("every", [1, 5])
def test_an_elastic_gear_is_bent_by_the_command_before(tmp_path: Path, every: int) -> None:
    """The encoder of a motor without inertia is ahead by the torque times the compliance."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    time, command, values = loop(every)
    values[:, 0] += 0.02 * values[:, 3]
    replayer = Replayer(study_of(path, time, command, values), step=1.0)
    gear, hinge = CATALOGUE["joint_elasticity"], Location("joint", ("hinge",))
    candidate = Candidate(gear, hinge, gear.parameters(replayer.system, hinge))
    bent = [(candidate, candidate.null_values() | {"compliance": 0.02})]

    error = replayer.measured.value - replayer.replay(bent).prediction

    angle = (replayer.measured.channel == 0) & (replayer.measured.time > every * STEP)
    assert np.std(0.02 * values[:, 3]) > 0.005
    np.testing.assert_allclose(error[angle], 0.0, atol=1e-9)
