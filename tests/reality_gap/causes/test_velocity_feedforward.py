"""Velocity feed-forward, against a drive that is a control loop of its own."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import diagnose, load_study
from reality_gap.causes import CATALOGUE
from reality_gap.inference.screening import list_candidates
from reality_gap.inference.verdict import Options
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study

AXIS = """<mujoco><option timestep="{step}" gravity="0 0 0" integrator="implicitfast"/>
<worldbody><body><joint name="axis" type="{kind}" axis="1 0 0" damping="{damping}"/>
<geom size="0.1" mass="{mass}"/></body></worldbody><actuator>{actuator}</actuator>
<sensor><jointpos name="position" joint="axis"/></sensor></mujoco>"""
SERVO = '<position name="drive" joint="axis" gear="{gear}" kp="{kp}" kv="{kd}"/>'
STUDY = """name: axis
model: model.xml
episodes: [{{commands: log.csv}}]
time: {{column: time, unit: s}}
actuators: {{drive: {{column: command, unit: {unit}}}}}
sensors: {{position: {{column: position, unit: {unit}, noise: {noise}}}}}
initial: {{settle: 0.5}}
"""
GANTRY = {"kind": "slide", "mass": 9.0, "damping": 30.0, "kp": 14e3, "kd": 650.0, "gear": 1.0}
WRIST = {"kind": "hinge", "mass": 0.5, "damping": 0.004, "kp": 0.002, "kd": 8e-5, "gear": 50.0}


def logged(folder: Path, machine: dict[str, float | str], share: float) -> Study:
    """Study of an axis whose drive runs at 10 kHz, with a set point each 12 ms."""
    axis = {name: machine[name] for name in ("kind", "mass", "damping")}
    servo = SERVO.format(**machine)
    (folder / "model.xml").write_text(AXIS.format(step=0.001, actuator=servo, **axis))
    motor = '<motor name="drive" joint="axis" gear="{gear}"/>'.format(**machine)
    real = mujoco.MjModel.from_xml_string(AXIS.format(step=1e-4, actuator=motor, **axis))
    data, rng = mujoco.MjData(real), np.random.default_rng(2)
    kp, kd, gear = (float(machine[name]) for name in ("kp", "kd", "gear"))
    noise, rows, before = 2e-4, [], 0.0
    for k in range(500):
        t = 0.012 * k
        moved = 0.0 if t > 4.5 else np.sin(1.9 * t) * np.sin(0.8 * t)
        set_point = 0.4 * gear * float(moved)
        read = float(data.qpos[0]) + noise * rng.standard_normal()
        rows.append(f"{t:.9g},{set_point:.9g},{read:.9g}")
        rate = (set_point - before) / 0.012
        for _ in range(120):
            position, velocity = gear * data.qpos[0], gear * data.qvel[0]
            data.ctrl[0] = kp * (set_point - position) + kd * (share * rate - velocity)
            mujoco.mj_step(real, data)
        before = set_point
    (folder / "log.csv").write_text("\n".join(["time,command,position", *rows]))
    unit = "m" if machine["kind"] == "slide" else "rad"
    (folder / "STUDY.yaml").write_text(STUDY.format(unit=unit, noise=noise))
    return load_study(folder / "STUDY.yaml")


@pytest.mark.parametrize("machine", [GANTRY, WRIST], ids=["gantry", "wrist"])
@pytest.mark.parametrize("share", [0.9, 0.4])
def test_the_servo_moves_as_the_drive(
    tmp_path: Path, machine: dict[str, float | str], share: float
) -> None:
    with Replayer(logged(tmp_path, machine, share)) as replayer:
        [ahead] = list_candidates(replayer.system, [CATALOGUE["velocity_feedforward"]])

        def left(value: float) -> float:
            residual = replayer.residual([(ahead, {"share": value})])
            return float(np.sqrt(np.mean(residual**2)))

        assert left(0.0) > 8.0
        assert left(share) == pytest.approx(1.0, abs=0.1)


def test_it_is_named_and_no_delay(tmp_path: Path) -> None:
    ids = ("velocity_feedforward", "velocity_gain", "position_gain", "delay", "viscous_friction")
    study = logged(tmp_path, GANTRY, 0.9)
    found = diagnose(study, causes=[CATALOGUE[id] for id in ids], options=Options(suggest=False))

    [one] = found.causes
    assert one.candidate.cause.id == "velocity_feedforward"
    assert one.parameters["share"].value == pytest.approx(0.9, abs=0.01)
