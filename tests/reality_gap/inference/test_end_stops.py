"""End stops, on an arm of two joints that runs into something, which a joint's limit simulates."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Diagnosis, Options, Verdict, diagnose, load_study
from reality_gap.causes import CATALOGUE

NOISE = 5e-4
"""Of the encoders [rad]."""
CAUSES = ["coulomb_friction", "joint_stiffness", "viscous_friction", "external_force"]

Edit = Callable[[mujoco.MjSpec], None]


def model(degrees: bool) -> str:
    """Return an arm in a model that uses degrees or radians, with a default tendon of its own."""
    reach = "-120 120" if degrees else "-2.1 2.1"
    return f"""
<mujoco>
  <compiler angle="{"degree" if degrees else "radian"}"/>
  <option timestep="0.002"/>
  <default><tendon stiffness="7" damping="3" springlength="0.1"/></default>
  <worldbody>
    <body>
      <joint name="shoulder" axis="0 1 0" range="{reach}" damping="0.05"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/>
      <body pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" range="{reach}" damping="0.05"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0.25 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="m_shoulder" joint="shoulder" kp="40" kv="2"/>
    <position name="m_elbow" joint="elbow" kp="20" kv="1"/>
  </actuator>
  <sensor>
    <jointpos name="at_shoulder" joint="shoulder"/>
    <jointpos name="at_elbow" joint="elbow"/>
  </sensor>
</mujoco>
"""


def diagnosis(folder: Path, edit: Edit, degrees: bool = False, seconds: float = 7.0) -> Diagnosis:
    """Simulate the edited arm, and diagnose the log with the model as it was."""
    (folder / "arm.xml").write_text(model(degrees))
    spec = mujoco.MjSpec.from_string(model(degrees))
    edit(spec)
    spec.option.timestep = 0.0005
    real = spec.compile()
    data, rng = mujoco.MjData(real), np.random.default_rng(3)
    time = 0.01 * np.arange(round(100 * seconds) + 1)
    waves = [np.sin(1.7 * time) + 0.3 * np.sin(3.1 * time), np.sin(2.3 * time + 1.0)]
    command = np.column_stack([0.5 * waves[0], 0.7 * waves[1]])
    data.ctrl[:] = command[0]
    mujoco.mj_step(real, data, 4000)
    rows = []
    for now, wanted in zip(time, command, strict=True):
        mujoco.mj_forward(real, data)
        rows.append([now, *wanted, *(data.qpos + NOISE * rng.standard_normal(2))])
        data.ctrl[:] = wanted
        mujoco.mj_step(real, data, 20)
    header = "time,c_shoulder,c_elbow,q_shoulder,q_elbow"
    np.savetxt(folder / "log.csv", rows, "%.9g", ",", header=header, comments="")
    joints = ("shoulder", "elbow")
    study = {
        "name": "arm",
        "model": "arm.xml",
        "episodes": [{"commands": "log.csv"}],
        "time": {"column": "time", "unit": "s"},
        "actuators": {f"m_{j}": {"column": f"c_{j}", "unit": "rad"} for j in joints},
        "sensors": {f"at_{j}": {"column": f"q_{j}", "unit": "rad", "noise": NOISE} for j in joints},
        "initial": {"settle": 2.0},
    }
    (folder / "STUDY.yaml").write_text(json.dumps(study))
    causes = [CATALOGUE[name] for name in CAUSES]
    found = load_study(folder / "STUDY.yaml")
    return diagnose(found, causes=causes, options=Options(suggest=False))


def stopped(end: float) -> Edit:
    """Return the edit by which the elbow runs into something at an end [rad]."""

    def edit(spec: mujoco.MjSpec) -> None:
        joint = spec.joint("elbow")
        far = 120.0 if spec.compiler.degree else 2.1
        end_there = np.rad2deg(end) if spec.compiler.degree else end
        joint.range = (-far, end_there) if end > 0 else (end_there, far)
        joint.solref_limit = (0.02, 1.0)

    return edit


@pytest.mark.parametrize(
    ("end", "name", "degrees"),
    [pytest.param(0.45, "upper", False, marks=pytest.mark.slow), (-0.4, "lower", True)],
)
def test_a_joint_that_runs_into_something_gets_no_name_but_is_located(
    tmp_path: Path, end: float, name: str, degrees: bool
) -> None:
    found = diagnosis(tmp_path, stopped(end), degrees)

    assert found.verdict is Verdict.UNEXPLAINED
    assert found.causes == ()
    assert "an end stop of elbow at " in found.sentence
    assert f"at the {name} end of its motion" in found.sentence
    assert " depends on the " not in found.sentence
    [gain] = [one for one in found.criteria if one.name == "gain_of_stop"]
    assert not gain.met
    position = float(gain.objection.split(" rad,")[0].split("elbow at ")[-1])
    assert position == pytest.approx(end, abs=0.02)


def test_a_spring_is_no_stop(tmp_path: Path) -> None:
    def edit(spec: mujoco.MjSpec) -> None:
        spec.joint("elbow").stiffness[0] = 0.4
        spec.joint("elbow").springref = 0.3

    found = diagnosis(tmp_path, edit)

    assert found.verdict is Verdict.NAMED
    assert [one.candidate.cause.id for one in found.causes] == ["joint_stiffness"]
    assert not [one for one in found.criteria if one.name == "gain_of_stop"]


@pytest.mark.slow
def test_a_stop_that_leaves_most_of_the_error_stops_nothing(tmp_path: Path) -> None:
    """The links are heavier, which none of these causes explains, nor does a stop.

    The spring in the elbow is found beside that.
    """

    def edit(spec: mujoco.MjSpec) -> None:
        for geom in spec.geoms:
            geom.density *= 3.0
        spec.joint("shoulder").damping[0] += 2.0
        spec.joint("elbow").frictionloss = 0.5
        spec.joint("elbow").stiffness[0] = 2.0

    found = diagnosis(tmp_path, edit, seconds=12.0)

    assert found.verdict is Verdict.PARTLY_NAMED
    spring = found.causes[0]
    assert (spring.candidate.cause.id, spring.candidate.location.elements) == (
        "joint_stiffness",
        ("elbow",),
    )
    assert spring.parameters["stiffness"].value == pytest.approx(2.0, rel=0.1)
    assert "stop" not in found.sentence
    assert not [one for one in found.criteria if one.name == "gain_of_stop"]
