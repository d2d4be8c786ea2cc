"""Muscles: their force may be another."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location
from tests.reality_gap.causes.plants import plant_with, system_of

MODEL = """
<mujoco>
  <worldbody>
    <site name="o" pos="0 0 0.3"/>
    <body>
      <joint name="elbow" axis="0 1 0" range="-1 1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/>
      <site name="i" pos="0.1 0 0.02"/>
    </body>
  </worldbody>
  <tendon><spatial name="biceps"><site site="o"/><site site="i"/></spatial></tendon>
  <actuator>{actuators}</actuator>
  <sensor><jointpos name="q" joint="elbow"/></sensor>
</mujoco>
"""
GIVEN = '<muscle name="biceps" tendon="biceps" force="400" lengthrange="0.1 0.5"/>'
DERIVED = '<muscle name="biceps" tendon="biceps" scale="150" lengthrange="0.1 0.5"/>'
MOTOR = '<motor name="motor" joint="elbow" gear="2" forcerange="-3 3" forcelimited="true"/>'


def force(model: mujoco.MjModel, command: float) -> float:
    """Force of the first actuator with this activation."""
    data = mujoco.MjData(model)
    data.act[:] = command
    data.ctrl[:] = command
    mujoco.mj_forward(model, data)
    return float(data.actuator_force[0])


@pytest.mark.parametrize("actuator", [GIVEN, DERIVED])
@pytest.mark.parametrize("command", [0.0, 0.3, 1.0])
def test_the_force_of_a_muscle_has_a_scale(tmp_path: Path, actuator: str, command: float) -> None:
    path = tmp_path / "muscle.xml"
    path.write_text(MODEL.format(actuators=actuator))
    system = system_of(path)
    at = Location("actuator", ("biceps",))
    assert at in find_cause("force_scale").locations(system)
    weak = plant_with(system, "force_scale", at, excess=-0.25).spec.compile()
    assert force(weak, command) == pytest.approx(0.75 * force(system.model, command), rel=1e-9)
    assert force(system.model, 1.0) < -10.0


def test_a_motor_beside_a_muscle_has_a_scale_too(tmp_path: Path) -> None:
    path = tmp_path / "both.xml"
    path.write_text(MODEL.format(actuators=MOTOR + GIVEN))
    system = system_of(path)
    at = Location("actuator", ("motor", "biceps"))
    assert at in find_cause("force_scale").locations(system)
    strong = plant_with(system, "force_scale", at, excess=0.5).spec.compile()
    assert force(strong, 1.0) == pytest.approx(1.5 * force(system.model, 1.0))
    assert force(strong, 10.0) == pytest.approx(4.5)
