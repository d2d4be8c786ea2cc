"""Elastic gears of servos that move fast, against the solution of their differential equation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete

from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.types import Floats
from tests.reality_gap.causes.candidates import candidate

STEP = 0.001
"""Time between readings, and between commands [s]."""
TIME: Floats = STEP * np.arange(2000, dtype=np.float64)
"""Time stamps of the log [s]."""
SERVO = """<mujoco><option timestep="0.0001" integrator="implicitfast" gravity="0 0 0"/><worldbody>
<body><joint name="j" axis="0 0 1"/><inertial pos="0 0 0" mass="0.01"
 diaginertia="{inertia} {inertia} {inertia}"/></body></worldbody>
<actuator><position name="servo" joint="j" kp="{kp}" kv="{kd}"/></actuator>
<sensor><jointpos name="angle" joint="j"/><jointactuatorfrc name="torque" joint="j"/></sensor>
</mujoco>"""


def commands() -> Floats:
    """Steps and a sine of 5 Hz, shape (2000,) [rad]."""
    return 0.3 * np.sin(10.0 * np.pi * TIME) + 0.2 * (np.floor(TIME / 0.35) % 2)


def solved(inertia: float, kp: float, kd: float, compliance: float) -> tuple[Floats, Floats]:
    """Return the motor's angle [rad] and the torque [N m], shape (n,) each.

    ``I q'' = T`` and ``T = kp (u - q - c T) - kd (q' + c T')``, with commands that are held.
    """
    lag = kd * compliance
    rates = [
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0 / inertia],
        [-kp / lag, -kd / lag, -(1.0 + kp * compliance) / lag],
    ]
    system = (np.array(rates), np.array([[0.0], [0.0], [kp / lag]]), np.eye(3), np.zeros((3, 1)))
    move, push, *_ = cont2discrete(system, STEP)
    state, found = np.zeros(3), []
    for command in commands():
        found.append(state)
        state = move @ state + push[:, 0] * command
    angle, _, torque = np.array(found).T
    return angle + compliance * torque, torque


@pytest.mark.parametrize(
    ("inertia", "kp", "kd", "compliance"),
    [(5e-6, 0.05, 1e-3, 16.0), (5e-6, 0.05, 1e-3, 60.0), (0.1, 50.0, 4.0, 0.02)],
    ids=["finger", "soft finger", "arm"],
)
def test_it_is_right_in_motions_that_are_faster_than_the_lag_of_the_gear(
    tmp_path: Path, inertia: float, kp: float, kd: float, compliance: float
) -> None:
    path = tmp_path / "model.xml"
    path.write_text(SERVO.format(inertia=inertia, kp=kp, kd=kd))
    channels = (
        Channel("angle", "angle", unit="rad", noise=1e-3),
        Channel("torque", "torque", unit="N m", noise=1e-3 * kp),
    )
    readings = tuple(Reading(TIME, one) for one in solved(inertia, kp, kd, compliance))
    study = Study("gear", path, channels, (Episode("log", TIME, commands()[:, None], readings),))

    with Replayer(study) as replayer:
        one = candidate(replayer.system, "joint_elasticity", "j")
        hypotheses = [[], [(one, {"compliance": compliance})]]
        before, after = (np.sqrt(np.mean(r**2)) for r in replayer.residuals(hypotheses))

    assert before > 10.0
    assert after < 1.0
