"""Springs in joints that servos hold against little load, such as those of a neck that turns."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Verdict, diagnose, load_study
from reality_gap.causes import CATALOGUE
from reality_gap.inference.verdict import Options
from reality_gap.study.data import Study

NECK = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
<body pos="0 0 1"><joint name="yaw" axis="0 0 1" damping="0.6" armature="0.01"
 stiffness="{stiffness}"/><geom type="box" size=".09 .07 .1" pos=".03 0 .1" mass="2.4"/></body>
</worldbody><actuator><position name="servo" joint="yaw" kp="8" kv="0.9" gear="{gear}"/></actuator>
<sensor><jointpos name="angle" joint="yaw"/></sensor></mujoco>"""
STUDY = """name: neck
model: neck.xml
episodes: [{commands: log.csv}]
time: {column: time, unit: s}
actuators: {servo: {column: command, unit: rad}}
sensors: {angle: {column: angle, unit: rad, noise: 0.001}}
initial: {joints: first_reading, settle: 0}
"""
KINDS = ("joint_stiffness", "command_gain", "encoder_scale", "viscous_friction", "position_gain")


def logged(folder: Path, stiffness: float, gear: float = 1.0) -> Study:
    """Study of a neck with a spring [N m/rad] that turns and rests for 10 s."""
    (folder / "neck.xml").write_text(NECK.format(stiffness=0.0, gear=gear))
    (folder / "STUDY.yaml").write_text(STUDY)
    model = mujoco.MjModel.from_xml_string(NECK.format(stiffness=stiffness, gear=gear))
    data, rng = mujoco.MjData(model), np.random.default_rng(3)
    goals = rng.uniform(-0.8, 0.8, 16)
    goals[0] = 0.0
    rows = []
    for k in range(500):
        now, share = goals[k // 50], min(1.0, (k % 50) / 30)
        before = goals[max(k // 50 - 1, 0)]
        data.ctrl[0] = gear * (before + (now - before) * share**2 * (3.0 - 2.0 * share))
        rows.append([0.02 * k, data.ctrl[0], data.qpos[0] + 0.001 * rng.standard_normal()])
        mujoco.mj_step(model, data, 10)
    np.savetxt(folder / "log.csv", rows, "%.9g", ",", header="time,command,angle", comments="")
    return load_study(folder / "STUDY.yaml")


@pytest.mark.parametrize(
    ("stiffness", "gear"),
    [
        pytest.param(0.8, 1.0, marks=pytest.mark.slow),
        pytest.param(2.0, 1.0, marks=pytest.mark.slow),
        (8.0, 2.0),
    ],
)
def test_a_spring_may_be_as_stiff_as_the_servo_that_holds_its_joint(
    tmp_path: Path, stiffness: float, gear: float
) -> None:
    """The only load is that of inertia."""
    causes = [CATALOGUE[id] for id in KINDS]
    study = logged(tmp_path, stiffness, gear)
    found = diagnose(study, causes=causes, options=Options(suggest=False))

    assert found.verdict is Verdict.NAMED
    assert [one.candidate.cause.id for one in found.causes] == ["joint_stiffness"]
    spring = found.causes[0].parameters["stiffness"]
    assert spring.value == pytest.approx(stiffness, rel=0.02)
    assert spring.low < stiffness < spring.high
