"""Elastic gears of servos that move fast, against the solution of their differential equation."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.signal import cont2discrete

from reality_gap.causes.joint_elasticity import CAUSE
from reality_gap.causes.support.elastic_gear import ElasticGear
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.system import compile_system
from reality_gap.types import Floats
from tests.reality_gap.causes.candidates import candidate

STEP = 0.001
"""Time between readings, and between commands [s]."""
TIME: Floats = STEP * np.arange(2000, dtype=np.float64)
"""Time stamps of the log [s]."""
SERVO = """<mujoco><option timestep="0.0001" integrator="implicitfast" gravity="0 0 0"/><worldbody>
<body><joint name="j" axis="0 0 1" armature="{armature}"/><inertial pos="0 0 0" mass="0.01"
 diaginertia="{inertia} {inertia} {inertia}"/></body></worldbody>
<actuator><position name="servo" joint="j" kp="{kp}" kv="{kd}"/></actuator>
<sensor><jointpos name="angle" joint="j"/><jointactuatorfrc name="torque" joint="j"/></sensor>
</mujoco>"""


def commands() -> Floats:
    """Steps and a sine of 5 Hz, shape (2000,) [rad]."""
    return 0.3 * np.sin(10.0 * np.pi * TIME) + 0.2 * (np.floor(TIME / 0.35) % 2)


def states(rates: list[list[float]], drive: list[float]) -> Floats:
    """Return the states (k, n) of ``x' = rates x + drive u`` at held commands u."""
    k = len(drive)
    system = np.array(rates), np.array(drive)[:, None], np.eye(k), np.zeros((k, 1))
    move, push, *_ = cont2discrete(system, STEP)
    state, found = np.zeros(k), []
    for command in commands():
        found.append(state)
        state = move @ state + push[:, 0] * command
    return np.array(found, dtype=np.float64).T


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
    angle, _, torque = states(rates, [0.0, 0.0, kp / lag])
    return angle + compliance * torque, torque


def solved_with_rotor(
    inertia: float, rotor: float, kp: float, kd: float, compliance: float
) -> tuple[Floats, Floats]:
    """Return what `solved` does, with a rotor, and the torque of the motor.

    ``rotor m'' = kp (u - m) - kd m' - T`` and ``T = (m - q) / c``.
    """
    spring = 1.0 / compliance
    rates = [
        [0.0, 1.0, 0.0, 0.0],
        [-spring / inertia, 0.0, spring / inertia, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [spring / rotor, 0.0, -(kp + spring) / rotor, -kd / rotor],
    ]
    _, _, motor, velocity = states(rates, [0.0, 0.0, 0.0, kp / rotor])
    before = np.concatenate([[0.0], commands()[:-1]])  # a reading is taken before a new command
    return motor, kp * (before - motor) - kd * velocity


def errors(
    folder: Path, servo: str, solution: tuple[Floats, Floats], kp: float, compliance: float
) -> tuple[float, float]:
    """RMS of the residual without and with the elastic gear [noise]."""
    path = folder / "model.xml"
    path.write_text(servo)
    channels = (
        Channel("angle", "angle", unit="rad", noise=1e-3),
        Channel("torque", "torque", unit="N m", noise=1e-3 * kp),
    )
    readings = tuple(Reading(TIME, one) for one in solution)
    study = Study("gear", path, channels, (Episode("log", TIME, commands()[:, None], readings),))
    with Replayer(study) as replayer:
        one = candidate(replayer.system, "joint_elasticity", "j")
        residuals = replayer.residuals([[], [(one, {"compliance": compliance})]])
    before, after = (float(np.sqrt(np.mean(r**2))) for r in residuals)
    return before, after


@pytest.mark.parametrize(
    ("inertia", "kp", "kd", "compliance"),
    [(5e-6, 0.05, 1e-3, 16.0), (5e-6, 0.05, 1e-3, 60.0), (0.1, 50.0, 4.0, 0.02)],
    ids=["finger", "soft finger", "arm"],
)
def test_it_is_right_in_motions_that_are_faster_than_the_lag_of_the_gear(
    tmp_path: Path, inertia: float, kp: float, kd: float, compliance: float
) -> None:
    servo = SERVO.format(inertia=inertia, kp=kp, kd=kd, armature=0.0)
    solution = solved(inertia, kp, kd, compliance)
    before, after = errors(tmp_path, servo, solution, kp, compliance)

    assert before > 10.0
    assert after < 1.0


@pytest.mark.parametrize(
    ("inertia", "rotor", "kp", "kd", "compliance"),
    [
        (0.1, 0.02, 50.0, 4.0, 0.02),
        (0.1, 0.1, 50.0, 4.0, 0.02),
        (0.1, 1.0, 400.0, 20.0, 0.002),
        (5e-6, 2e-5, 0.05, 1e-3, 16.0),
        (5e-6, 2e-6, 0.05, 1e-3, 2.0),
    ],
    ids=["light", "as the link", "ten times the link", "finger", "light finger"],
)
@pytest.mark.parametrize("integrator", ["implicitfast", "Euler"])
def test_a_rotor_moves_with_the_motor(
    tmp_path: Path,
    integrator: str,
    inertia: float,
    rotor: float,
    kp: float,
    kd: float,
    compliance: float,
) -> None:
    servo = SERVO.format(inertia=inertia, kp=kp, kd=kd, armature=rotor)
    servo = servo.replace("implicitfast", integrator)
    solution = solved_with_rotor(inertia, rotor, kp, kd, compliance)
    before, after = errors(tmp_path, servo, solution, kp, compliance)

    assert before > 3.0
    assert after < 0.5


@pytest.mark.parametrize(("kp", "kd"), [(50.0, 4.0), (50.0, 0.0)], ids=["damped", "undamped"])
@pytest.mark.parametrize("rotor", [0.0, 0.001, 0.1, 10.0])
def test_a_stiff_gear_at_coarse_steps_is_a_rigid_one(
    tmp_path: Path, kp: float, kd: float, rotor: float
) -> None:
    servo = SERVO.format(inertia=0.1, kp=kp, kd=kd, armature=rotor).replace("0.0001", "0.004")
    nothing = np.zeros(len(TIME)), np.zeros(len(TIME))
    before, after = errors(tmp_path, servo, nothing, kp, 1e-7)

    assert before > 30.0
    assert after == pytest.approx(before, rel=1e-3)


CHAIN = """<mujoco><option timestep="{step}" integrator="{integrator}"/><default>
<joint axis="0 1 0" armature="{rotor}" damping="{damping}" frictionloss="0.5"/></default>
<worldbody><body><joint name="a"/><geom type="capsule" size=".03" fromto="0 0 0 .4 0 0" mass="1"/>
<body pos=".4 0 0"><joint name="b"/><geom type="capsule" size=".02" mass=".1"
fromto="0 0 0 .1 0 0"/>
</body></body></worldbody><actuator><position name="a" joint="a" kp="{kp}" kv="{kd}"/>
<position name="b" joint="b" kp="{kp}" kv="{kd}"/></actuator></mujoco>"""


@pytest.mark.parametrize("joint", ["a", "b"])
@pytest.mark.parametrize(
    ("integrator", "step", "rotor", "damping", "kp", "kd", "compliance"),
    [
        ("implicitfast", 3.3e-4, 8.4, 6.1, 240.0, 5.3, 1.3e-4),
        ("implicitfast", 5e-3, 0.023, 13.0, 65.0, 6.1, 7e-3),
        ("implicit", 4.8e-3, 0.35, 16.0, 14.0, 0.28, 4e-4),
        ("Euler", 2e-3, 0.01, 0.3, 100.0, 0.5, 1e-3),
    ],
)
def test_light_links_with_much_friction_are_stable(
    joint: str,
    integrator: str,
    step: float,
    rotor: float,
    damping: float,
    kp: float,
    kd: float,
    compliance: float,
) -> None:
    text = CHAIN.format(
        step=step, integrator=integrator, rotor=rotor, damping=damping, kp=kp, kd=kd
    )
    largest = []
    for gears in ([], [joint]):
        model = mujoco.MjModel.from_xml_string(text)
        data, top = mujoco.MjData(model), 0.0
        hooks = [ElasticGear(model, name, name, compliance, 1.0) for name in gears]
        for time in step * np.arange(int(2.0 / step)):
            data.ctrl[:] = 0.5 * np.sin(4.0 * time), 0.3 * np.sign(np.sin(9.0 * time))
            for hook in hooks:
                hook(model, data)
            mujoco.mj_step(model, data)
            top = max(top, float(np.abs(data.qpos).max()))
        assert not data.warning.number.any()
        largest.append(top)

    rigid, elastic = largest
    assert elastic < 2.0 * rigid


GEARED = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody><body>
<joint name="j" axis="0 1 0" damping="0.1" {joint}/>
<geom type="capsule" size=".03" fromto="0 0 0 .3 0 0" mass="1"/></body></worldbody>
<actuator><position name="m" joint="j" gear="-2" kp="12" {servo}/></actuator></mujoco>"""


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (("armature='0.08'", "kv='1'"), ("", "kv='1' armature='0.02'")),
        (("armature='0.08'", "kv='1'"), ("armature='0.08'", "damping='1'")),
        (
            ("armature='0.08'", "kv='1' forcerange='-1 1.5'"),
            ("armature='0.08' actuatorfrcrange='-3 2'", "kv='1'"),
        ),
    ],
    ids=["armature", "damping", "limits"],
)
@pytest.mark.parametrize("compliance", [1e-6, 0.02])
def test_it_matters_not_where_a_model_has_the_numbers_of_a_motor(
    compliance: float, one: tuple[str, str], other: tuple[str, str]
) -> None:
    found = []
    for joint, servo in (one, other):
        model = mujoco.MjModel.from_xml_string(GEARED.format(joint=joint, servo=servo))
        data, moved = mujoco.MjData(model), []
        gear = ElasticGear(model, "m", "j", compliance, 1.0)
        for time in 0.002 * np.arange(1000):
            data.ctrl[0] = np.sin(5.0 * time)
            gear(model, data)
            mujoco.mj_step(model, data)
            moved.append(float(data.qpos[0]))
        found.append((np.array(moved), *gear.exerted(1000)))

    for first, second in zip(*found, strict=True):
        assert np.ptp(first) > 0.1
        np.testing.assert_allclose(first, second, atol=1e-3 * np.ptp(first))


@pytest.mark.parametrize(
    ("joint", "servo", "least", "most"),
    [
        ("actuatorfrcrange='-3 2'", "", -3.0, 2.0),
        ("", "forcerange='-1 1.5'", -3.0, 2.0),
        ("actuatorfrcrange='-2.5 9'", "forcerange='-1 1.5'", -2.5, 2.0),
    ],
    ids=["joint", "actuator", "both"],
)
def test_a_motor_behind_a_spring_exerts_no_more_than_its_limits(
    joint: str, servo: str, least: float, most: float
) -> None:
    """The gear of -2 turns the limits of the actuator around."""
    text = GEARED.format(joint=f"armature='0.08' {joint}", servo=f"kv='1' {servo}")
    model = mujoco.MjModel.from_xml_string(text)
    data, gear = mujoco.MjData(model), ElasticGear(model, "m", "j", 0.02, 1.0)
    for time in 0.002 * np.arange(1000):
        data.ctrl[0] = 3.0 * np.sin(5.0 * time)
        gear(model, data)
        mujoco.mj_step(model, data)
    motor, _ = gear.exerted(1000)

    assert motor.min() == least
    assert motor.max() == most


@pytest.mark.parametrize(
    ("actuator", "count"),
    [
        ("<position name='m' joint='j' kp='12'/>", 1),
        ("<motor name='m' joint='j' gear='0'/>", 0),
        ("<general name='m' joint='j' gainprm='-3' biastype='affine' biasprm='0 3 0'/>", 0),
    ],
    ids=["servo", "no gear", "positive feedback"],
)
def test_a_motor_that_holds_nothing_has_no_elastic_gear(
    tmp_path: Path, actuator: str, count: int
) -> None:
    text = SERVO.format(inertia=0.1, kp=1.0, kd=0.1, armature=0.1)
    begin, end = text.index("<position"), text.index("</actuator>")
    path = tmp_path / "model.xml"
    path.write_text(text[:begin] + actuator + text[end:])
    channels = (Channel("angle", "angle", unit="rad", noise=1e-3),)
    readings = (Reading(TIME, 0.0 * TIME),)
    study = Study("gear", path, channels, (Episode("log", TIME, commands()[:, None], readings),))
    assert len(CAUSE.locations(compile_system(study))) == count
