"""Clock lags of readings, among them forces that jump with the commands."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.simulation.clock_lags import ClockLag, clock_lag
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.types import Floats

CART = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="rail" type="slide" axis="1 0 0" damping="20"/>
      <geom type="sphere" size="0.05" mass="2"/>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="rail" kp="20000" kv="600"/></actuator>
  <sensor>
    <jointpos name="position" joint="rail"/>
    <actuatorfrc name="force" actuator="servo"/>
  </sensor>
</mujoco>
"""
CHANNELS = (
    Channel("position", "position", unit="m", noise=1e-4),
    Channel("force", "force", unit="N", noise=1.0),
)
PERIOD = 0.05
"""Time between commands [s]."""


def simulated(seconds: float = 12.0) -> tuple[Floats, Floats, Floats]:
    """Read, then command; return times (n,), commands (n, 1), and readings (n, 2)."""
    model = mujoco.MjModel.from_xml_string(CART)
    data, rng = mujoco.MjData(model), np.random.default_rng(1)
    time = PERIOD * np.arange(round(seconds / PERIOD))
    wanted = 0.2 * np.sin(2.0 * time) + 0.1 * np.sin(5.3 * time) + rng.normal(0, 0.01, len(time))
    readings = np.zeros((len(time), 2))
    for row, target in zip(readings, wanted, strict=True):
        force = data.actuator_force[0]
        mujoco.mj_forward(model, data)
        row[:] = data.qpos[0], force
        data.ctrl[:] = target
        mujoco.mj_step(model, data, round(PERIOD / model.opt.timestep))
    noise = rng.standard_normal(readings.shape) * [c.noise for c in CHANNELS]
    return time, wanted[:, None], readings + noise


def lag_of(
    folder: Path, late: tuple[float, float], channels: tuple[int, ...], own_clock: bool = False
) -> ClockLag | None:
    """Return the lag of some channels whose clocks, of position and force, are late [s]."""
    path = folder / "cart.xml"
    path.write_text(CART)
    time, command, values = simulated()
    readings = tuple(
        Reading(time[first:] + lag, values[first:, c])
        for c, lag in enumerate(late)
        for first in [int(np.searchsorted(time, -lag))]
    )
    episode = Episode("log", time, command, readings)
    study = Study("cart", path, CHANNELS, (episode,), Initial(settle=0.0))
    with Replayer(study) as replayer:
        record = replayer.replay([]).records[0]
        return clock_lag(replayer, record, 0, channels, own_clock)


@pytest.mark.parametrize("own_clock", [False, True])
@pytest.mark.parametrize("channels", [(0, 1), (0,), (1,)])
def test_readings_without_lag_have_none_though_forces_jump_with_commands(
    tmp_path: Path, channels: tuple[int, ...], own_clock: bool
) -> None:
    assert lag_of(tmp_path, (0.0, 0.0), channels, own_clock) is None


@pytest.mark.parametrize("late", [0.3, -0.25])
@pytest.mark.parametrize(
    ("channels", "error"),
    [((0, 1), 0.01), ((0,), 0.01), ((1,), PERIOD)],  # forces decay alike after each command
)
def test_the_lag_of_positions_and_of_forces_is_found(
    tmp_path: Path, channels: tuple[int, ...], error: float, late: float
) -> None:
    found = lag_of(tmp_path, (late, late), channels)

    assert found is not None
    assert found.seconds == pytest.approx(late, abs=error)


def test_forces_that_are_late_beside_positions_that_are_not_have_no_common_lag(
    tmp_path: Path,
) -> None:
    assert lag_of(tmp_path, (0.0, 0.2), (0, 1)) is None
