"""A pendulum that nothing drives, and a joint whose model has too much or too little friction."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Diagnosis, Options, Verdict, diagnose, load_study
from reality_gap.causes import CATALOGUE

PENDULUM = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
<body pos="0 0 1"><joint name="pivot" axis="0 1 0" damping="{damping}" frictionloss="{friction}"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="0.6"/></body></worldbody>
{motor}<sensor><jointpos name="angle" joint="pivot"/></sensor></mujoco>"""
MOTOR = '<actuator><motor name="motor" joint="pivot"/></actuator>'
STUDY = """name: pendulum
model: pendulum.xml
episodes:
  - commands: log.csv
time: {{column: time, unit: s}}
{actuators}sensors:
  angle: {{column: angle, unit: rad, noise: 5e-4}}
initial: {{joints: first_reading, settle: 0}}
"""
KINDS = ("viscous_friction", "coulomb_friction", "link_mass", "armature", "joint_stiffness")


def diagnosis(
    folder: Path,
    nominal: tuple[float, float],
    actual: tuple[float, float],
    motor: bool,
) -> Diagnosis:
    """Diagnosis of a log, given damping and friction of the model and of the machine."""

    def text(values: tuple[float, float]) -> str:
        damping, friction = values
        return PENDULUM.format(damping=damping, friction=friction, motor=MOTOR if motor else "")

    (folder / "pendulum.xml").write_text(text(nominal))
    model = mujoco.MjModel.from_xml_string(text(actual))
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(2), []
    data.qpos[0] = 0.0 if motor else 0.9
    for k in range(500):
        time = 0.01 * k
        command = [0.8 * np.sin(2.5 * time) + 0.3 * np.sin(7.0 * time)] if motor else []
        data.ctrl[:] = command
        rows.append([time, *command, data.qpos[0] + 5e-4 * rng.standard_normal()])
        mujoco.mj_step(model, data, 5)
    header = "time,motor,angle" if motor else "time,angle"
    np.savetxt(folder / "log.csv", rows, "%.9g", ",", header=header, comments="")
    actuators = "actuators:\n  motor: {column: motor, unit: N m}\n" if motor else ""
    (folder / "STUDY.yaml").write_text(STUDY.format(actuators=actuators))
    causes = [CATALOGUE[id] for id in KINDS]
    return diagnose(
        load_study(folder / "STUDY.yaml"), causes=causes, options=Options(suggest=not motor)
    )


def test_damping_of_a_machine_without_motors_is_named(tmp_path: Path) -> None:
    found = diagnosis(tmp_path, (0.004, 0.0), (0.03, 0.0), motor=False)

    assert [str(cause.candidate) for cause in found.causes] == ["viscous_friction at pivot"]
    assert found.causes[0].parameters["damping"].value == pytest.approx(0.026, rel=0.05)
    assert found.next_experiment is None


def test_what_tolerances_excuse_is_mentioned_where_it_is_large(tmp_path: Path) -> None:
    found = diagnosis(tmp_path, (0.004, 0.0), (0.006, 0.0), motor=False)

    assert found.verdict is Verdict.NOTHING_WRONG
    assert found.rms_before > 5.0
    assert f"They are {found.rms_before:.3g} noises; deviations of at most" in found.sentence


@pytest.mark.parametrize(("nominal", "actual"), [(1.5, 0.15), (0.4, 0.15), (0.1, 0.4)])
def test_friction_loss_of_the_model_may_be_too_large_or_too_small(
    tmp_path: Path, nominal: float, actual: float
) -> None:
    found = diagnosis(tmp_path, (0.1, nominal), (0.1, actual), motor=True)

    assert [str(cause.candidate) for cause in found.causes] == ["coulomb_friction at pivot"]
    friction = found.causes[0].parameters["friction"].value
    assert friction == pytest.approx(actual - nominal, rel=0.1)
