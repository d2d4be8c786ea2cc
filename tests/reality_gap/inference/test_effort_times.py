"""Efforts that act until the next sample, or since the one before, and those that are really late.

The log is a simulated one, with MuJoCo's friction, of a controller at 100 Hz.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Diagnosis, Verdict, diagnose
from reality_gap.causes import CATALOGUE
from reality_gap.inference.verdict import Options
from reality_gap.report.html import page
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.types import Floats, Ints

pytestmark = pytest.mark.usefixtures("no_figures")

ARM = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body>
<joint name="hinge" axis="0 1 0" damping="{damping}" armature="0.02" frictionloss="{friction}"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="1.5"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator>
<sensor><jointpos name="angle" joint="hinge"/></sensor></mujoco>"""
PERIOD, STEPS, COUNT = 0.01, 10, 2000
ANGLE_NOISE, TORQUE_NOISE = 5e-5, 0.02
KINDS = ("delay", "viscous_friction", "coulomb_friction", "link_mass", "armature", "force_offset")


def recorded(damping: float, friction: float, steps: Ints | None = None) -> tuple[Floats, Floats]:
    """Return the angle at each sample, and the torque from then until the next one, (n,) each.

    Args:
        damping, friction: of the machine [N m s/rad] and [N m].
        steps: of a millisecond between two samples, shape (n,); by default `STEPS`.
    """
    steps = np.full(COUNT, STEPS) if steps is None else steps
    model = mujoco.MjModel.from_xml_string(ARM.format(damping=damping, friction=friction))
    data, rng = mujoco.MjData(model), np.random.default_rng(4)
    angle, torque = np.empty(COUNT), np.empty(COUNT)
    for k in range(COUNT):
        goal = 0.6 * np.sin(2.3 * data.time) + 0.3 * np.sin(5.1 * data.time)
        angle[k] = data.qpos[0]
        torque[k] = data.ctrl[0] = 40.0 * (goal - angle[k]) - 3.0 * data.qvel[0]
        mujoco.mj_step(model, data, int(steps[k]))
    return angle + ANGLE_NOISE * rng.standard_normal(COUNT), torque


def diagnosis(
    folder: Path, effort: Floats, angle: Floats, friction: float, time: Floats | None = None
) -> Diagnosis:
    """Return the diagnosis of a log of efforts (n,) at angles (n,) by the model of the arm.

    Samples are even unless their times (n,) are given. Its page is written to the same folder.
    """
    path = folder / "arm.xml"
    path.write_text(ARM.format(damping=0.4, friction=friction))
    count = len(angle)
    time = PERIOD * np.arange(count) if time is None else time
    channels = (
        Channel("angle", "angle", unit="rad", noise=ANGLE_NOISE),
        Channel("torque", "hinge", unit="N m", noise=TORQUE_NOISE, kind="effort"),
    )
    noise = TORQUE_NOISE * np.random.default_rng(5).standard_normal(count)
    readings = (Reading(time, angle), Reading(time, effort + noise))
    study = Study("arm", path, channels, (Episode("only", time, np.zeros((count, 1)), readings),))
    causes = [CATALOGUE[id] for id in KINDS]
    found = diagnose(study, causes=causes, options=Options(suggest=False))
    (folder / "report.html").write_text(page(found, study), encoding="utf-8")
    return found


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize(("before", "word"), [(0, "early"), (1, "late")])
def test_efforts_of_half_a_sample_later_or_earlier_are_no_fault(
    tmp_path: Path, before: int, word: str, friction: float
) -> None:
    angle, torque = recorded(0.4, friction)
    found = diagnosis(tmp_path, np.roll(torque, before), angle, friction)

    assert found.verdict is Verdict.NOTHING_WRONG
    assert found.measures["efforts_late"] == pytest.approx((before - 0.5) * PERIOD)
    assert f"The efforts are {word} by half a sample, 5 ms" in found.sentence


def test_efforts_are_held_in_a_log_whose_samples_are_not_even(tmp_path: Path) -> None:
    """Samples last 13 to 21 ms."""
    steps = np.random.default_rng(7).integers(13, 22, COUNT)
    angle, torque = recorded(0.4, 0.0, steps)
    time = 0.001 * np.r_[0, np.cumsum(steps[:-1])]
    found = diagnosis(tmp_path, torque, angle, 0.0, time)

    assert found.verdict is Verdict.NOTHING_WRONG
    assert found.measures["efforts_late"] == pytest.approx(-0.0085, abs=6e-4)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_efforts_in_the_middle_are_compared_as_they_are(tmp_path: Path, friction: float) -> None:
    """Dry friction of a simulation changes its sign 10 ms before the velocity does."""
    angle, torque = recorded(0.4, friction)
    found = diagnosis(tmp_path, 0.5 * (torque + np.roll(torque, 1)), angle, friction)

    assert found.verdict is Verdict.NOTHING_WRONG
    assert found.rms_after == pytest.approx(1.0, abs=0.2)
    assert "efforts_late" not in found.measures
    assert bool(found.measures["own_time_step"]) is (friction > 0.0)
    assert ("is as soft as in MuJoCo" in (tmp_path / "report.html").read_text()) is (friction > 0.0)


@pytest.mark.parametrize("late", [0.2, 0.35, 1.1, 2.0])
def test_efforts_that_are_late_by_other_times_are(tmp_path: Path, late: float) -> None:
    angle, torque = recorded(0.4, 0.0)
    time = np.arange(COUNT)
    middle = np.interp(time - late, time + 0.5, torque)
    found = diagnosis(tmp_path, middle, angle, 0.0)

    assert [cause.candidate.cause.id for cause in found.causes] == ["delay"]
    assert found.causes[0].parameters["delay"].value == pytest.approx(late * PERIOD, abs=6e-4)
    assert "efforts_late" not in found.measures


def test_a_fault_is_found_beside_efforts_that_are_held(tmp_path: Path) -> None:
    angle, torque = recorded(0.6, 0.3)
    found = diagnosis(tmp_path, torque[:1000], angle[:1000], 0.3)

    assert [cause.candidate.cause.id for cause in found.causes] == ["viscous_friction"]
    damping = found.causes[0].parameters["damping"]
    assert damping.low < 0.2 < damping.high
    assert found.measures["efforts_late"] == pytest.approx(-0.5 * PERIOD)
