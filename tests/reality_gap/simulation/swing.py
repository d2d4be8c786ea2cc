"""Logs of a pendulum that a motor swings without feedback, and that turns over."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from reality_gap import Study, load_study

MODEL = """<mujoco><option timestep="{step}"{more}/><worldbody><body pos="0 0 1">
<joint name="pivot" axis="0 1 0" frictionloss="{friction}" damping="{damping}"/>
<inertial pos="0 0 -0.43" mass="0.675" diaginertia="0.0033 0.0033 0.0007"/></body></worldbody>
<actuator><motor name="motor" joint="pivot" ctrlrange="-12 12"/></actuator>
<sensor><jointpos name="angle" joint="pivot"/></sensor></mujoco>"""
STUDY = """name: pendulum
model: model.xml
episodes: [{commands: log.csv}]
time: {column: time, unit: s}
actuators: {motor: {column: torque, unit: N m}}
sensors: {angle: {column: angle, unit: rad, noise: 1e-3}}
initial: {joints: first_reading, settle: 0%s}
"""
NOISE, PERIOD, FINE = 1e-3, 0.004, 0.0002
RK4 = ' integrator="RK4"'


def swung(
    folder: Path,
    friction: float,
    seconds: float = 8.0,
    damping: float = 0.0,
    restart: str = "",
    torque: float = 1.0,
) -> tuple[Study, np.ndarray]:
    """Return a study and the true states, shape (n, 2) [rad] and [rad/s].

    The machine is simulated with fine steps of another integrator; its model has no friction.
    """
    model = MODEL.format(step=0.002, more=RK4, friction=0.0, damping=damping)
    (folder / "model.xml").write_text(model)
    (folder / "STUDY.yaml").write_text(STUDY % restart)
    real = mujoco.MjModel.from_xml_string(
        MODEL.format(step=FINE, more=RK4, friction=friction, damping=damping)
    )
    data, rng, rows, states = mujoco.MjData(real), np.random.default_rng(0), [], []
    for t in np.arange(0.0, seconds, PERIOD):
        waves = 1.6 * np.sin(2.0 * t) + 1.1 * np.sin(3.1 * t + 1.0) + 0.5 * np.sin(5.3 * t)
        data.ctrl[0] = torque * waves
        rows.append([t, data.ctrl[0], data.qpos[0] + NOISE * rng.standard_normal()])
        states.append([data.qpos[0], data.qvel[0]])
        mujoco.mj_step(real, data, round(PERIOD / FINE))
    np.savetxt(folder / "log.csv", rows, "%.9g", ",", header="time,torque,angle", comments="")
    return load_study(folder / "STUDY.yaml"), np.array(states)
