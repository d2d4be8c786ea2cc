"""Tolerance of the time step: a log that was simulated with a step of its own is no fault."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.inference.tolerances import tolerance_columns
from reality_gap.inference.whitening import likeliest_sizes
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.types import Floats

SLED = """
<mujoco>
  <option timestep="0.01" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="rail" type="slide" axis="1 0 0" damping="2" range="-0.2 0.15" limited="true"/>
      <geom type="sphere" size="0.05" mass="1"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="rail"/></actuator>
  <sensor><jointpos name="at_rail" joint="rail"/></sensor>
</mujoco>
"""
NOISE = 2e-4
"""Of the position [m]."""
TIME = 0.05 * np.arange(161)
FORCE = 3.0 * np.sin(4.0 * TIME)


def simulated(step: float) -> Floats:
    """Return the positions (n,) of a sled that hits its stops, with this time step [m]."""
    model = mujoco.MjModel.from_xml_string(SLED)
    model.opt.timestep = step
    data, found = mujoco.MjData(model), np.zeros(len(TIME))
    for k, force in enumerate(FORCE):
        found[k] = data.qpos[0]
        data.ctrl[0] = force
        mujoco.mj_step(model, data, round(0.05 / step))
    return found


@pytest.fixture
def study(tmp_path: Path) -> Study:
    """Study of a log that was simulated with half the step."""
    path = tmp_path / "sled.xml"
    path.write_text(SLED)
    reading = Reading(TIME, simulated(0.005))
    episode = Episode("only", TIME, FORCE[:, None], (reading,))
    channel = Channel("at_rail", "at_rail", unit="m", noise=NOISE)
    return Study("sled", path, (channel,), (episode,), Initial(settle=0.0))


def test_a_log_that_was_simulated_with_half_the_step_is_explained(study: Study) -> None:
    with Replayer(study, step=1.0) as replayer:
        residual = replayer.residual([])
        columns = tolerance_columns(replayer, [], residual)
    every = np.ones(len(residual), dtype=bool)
    sizes = likeliest_sizes(columns, np.ones(len(residual)), every, residual)
    left = residual - columns @ sizes

    power, rest = (float(np.mean(one**2)) for one in (residual, left))
    assert power > 5.0**2  # the residual is that beside a simulation without an error of the step
    assert rest < 0.01 * power
    assert np.abs(sizes).max() < 3.0


def test_a_log_that_was_simulated_with_the_step_of_replays_is_exact(study: Study) -> None:
    """Also at the times of commands, before which there are ten steps under the same one."""
    with Replayer(study) as replayer:
        replayer.own_step = True

        assert replayer.step == 0.5
        assert np.abs(replayer.residual([])).max() < 1e-6
