"""Faults of a servo that is far from its model, neither of which pays alone."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Options, diagnose, load_study

SERVO = """<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody><body>
<joint name="elbow" axis="0 1 0" damping="0.6" frictionloss="{friction}" stiffness="{spring}"
 armature="0.028" range="-1.7 1.7"/>
<inertial pos="0.12 0 0" mass="0.28" diaginertia="5e-4 1.2e-3 1.2e-3"/></body></worldbody><actuator>
<position name="elbow" joint="elbow" kp="{kp}" kv="{kv}" forcerange="-3.35 3.35"/></actuator>
<sensor><jointpos name="angle" joint="elbow"/></sensor></mujoco>"""
STUDY = """name: servo
model: model.xml
episodes: [{commands: log.csv}]
time: {column: time, unit: s}
actuators: {elbow: {column: command, unit: rad}}
sensors: {angle: {column: angle, unit: rad, noise: 4.4e-4}}
initial: {joints: first_reading, settle: 0}
"""


@pytest.mark.slow
def test_a_soft_servo_with_a_spring_and_friction_is_found(tmp_path: Path) -> None:
    """Its gain is a hundredth of that of the model, which is 290 noises off."""
    (tmp_path / "model.xml").write_text(SERVO.format(kp=998.0, kv=2.7, friction=0.05, spring=0.0))
    machine = SERVO.format(kp=9.0, kv=0.05, friction=0.25, spring=3.0)
    data = mujoco.MjData(real := mujoco.MjModel.from_xml_string(machine))
    rng, rows, time = np.random.default_rng(1), [], 0.02 * np.arange(300)
    command = 0.5 * np.sin(2.3 * time) + 0.3 * np.sin(5.1 * time + 1.0)
    data.ctrl[:] = command[0]
    mujoco.mj_step(real, data, 2000)
    for t, wanted in zip(time, command, strict=True):
        rows.append([t, wanted, data.qpos[0] + 4.4e-4 * rng.standard_normal()])
        data.ctrl[:] = wanted
        mujoco.mj_step(real, data, 10)
    header = "time,command,angle"
    np.savetxt(tmp_path / "log.csv", rows, "%.9g", ",", header=header, comments="")
    (tmp_path / "STUDY.yaml").write_text(STUDY)
    found = diagnose(load_study(tmp_path / "STUDY.yaml"), options=Options(suggest=False))

    assert found.verdict.has_names
    named = {one.candidate.cause.id: one.parameters for one in found.causes}
    assert named["position_gain"]["excess"].value == pytest.approx(9.0 / 998.0 - 1.0, abs=0.002)
    assert named["joint_stiffness"]["stiffness"].value == pytest.approx(3.0, rel=0.1)
