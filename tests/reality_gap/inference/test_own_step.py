"""Logs that were simulated with the model's own time step, and logs of a machine without one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Diagnosis, Verdict, diagnose, load_study
from reality_gap.causes import CATALOGUE
from reality_gap.inference.verdict import Options
from reality_gap.report.html import page
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from tests.reality_gap.servo_arm import ARM, STUDY

pytestmark = pytest.mark.usefixtures("no_figures")

STEP, NOMINAL, PERIOD, NOISE, LATE = 0.002, 0.01, 0.02, 3e-4, 0.02
KINDS = ("armature", "viscous_friction", "link_mass", "velocity_gain", "actuator_lag")


def arm(step: float, armature: float) -> str:
    return ARM.format(step=step, integrator="Euler", armature=armature, rotor=0.02, kv=(2.0, 0.3))


def diagnosis(folder: Path, step: float, armature: float = NOMINAL) -> tuple[Diagnosis, str]:
    """Diagnosis of a log that was simulated with a step, and its page."""
    study = study_of(folder, step, armature)
    causes = [CATALOGUE[id] for id in KINDS]
    found = diagnose(study, causes=causes, options=Options(suggest=False))
    return found, page(found, study)


def study_of(folder: Path, step: float, armature: float, pushed: float = 0.0) -> Study:
    """Study of such a log, of an arm that unknown torques of a size push [N m]."""
    (folder / "arm.xml").write_text(arm(STEP, NOMINAL))
    (folder / "STUDY.yaml").write_text(STUDY.format(noise=NOISE))
    model = mujoco.MjModel.from_xml_string(arm(step, armature))
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(5), []
    for k in range(-100, 300):
        time = PERIOD * max(k, 0)
        data.ctrl[:] = 0.4 * np.sin(3.0 * time) + 0.1 * np.sin(11.0 * time), np.cos(4.0 * time)
        data.qfrc_applied[:] = pushed * np.sin(7.0 * time), -pushed * np.cos(9.0 * time)
        if k >= 0:
            readings = data.qpos + NOISE * rng.standard_normal(2)
            rows.append([time, *data.ctrl, *readings])
        mujoco.mj_step(model, data, round(PERIOD / step))
    header = "time,m_upper,m_lower,upper,lower"
    np.savetxt(folder / "log.csv", rows, "%.9g", ",", header=header, comments="")
    return load_study(folder / "STUDY.yaml")


def test_a_simulated_log_without_a_fault_is_explained_to_the_noise(tmp_path: Path) -> None:
    found, report = diagnosis(tmp_path, STEP)

    assert found.verdict is Verdict.NOTHING_WRONG
    assert found.rms_before == pytest.approx(1.0, abs=0.12)
    assert "as one does that\nwas simulated with this model" in report


def test_a_log_of_finer_steps_is_not_taken_for_a_simulated_one(tmp_path: Path) -> None:
    found, report = diagnosis(tmp_path, STEP / 16)

    assert found.verdict is Verdict.NOTHING_WRONG
    assert found.rms_before == pytest.approx(1.0, abs=0.3)
    assert "simulated with this model" not in report


@pytest.mark.parametrize(
    ("step", "own"), [(STEP, True), pytest.param(STEP / 16, False, marks=pytest.mark.slow)]
)
def test_a_fault_has_its_size_in_both(tmp_path: Path, step: float, own: bool) -> None:
    found, _ = diagnosis(tmp_path, step, 1.5 * NOMINAL)

    assert found.verdict is Verdict.NAMED
    assert [str(cause.candidate) for cause in found.causes] == ["armature at lower"]
    inertia = found.causes[0].parameters["inertia"]
    assert inertia.value == pytest.approx(0.5 * NOMINAL, rel=0.06)
    assert bool(found.measures["own_time_step"]) is own


def test_the_error_of_the_step_is_that_of_the_machine_with_its_fault(tmp_path: Path) -> None:
    """With four times the inertia of a rotor the error of a step is another one."""
    found, _ = diagnosis(tmp_path, STEP / 16, 4.0 * NOMINAL)

    inertia = found.causes[0].parameters["inertia"]
    assert inertia.low < 3.0 * NOMINAL < inertia.high
    assert inertia.value == pytest.approx(3.0 * NOMINAL, rel=0.005)
    assert found.rms_after == pytest.approx(1.0, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("step", "own"), [(STEP / 16, False), (STEP, True)])
def test_large_faults_make_no_log_a_simulated_one(tmp_path: Path, step: float, own: bool) -> None:
    """About them the error of a step is so different that none was nearer to it."""
    study = study_of(tmp_path, step, 4.0 * NOMINAL)
    [episode] = study.episodes
    late = tuple(replace(r, time=r.time + LATE) for r in episode.readings)
    study = replace(study, episodes=(replace(episode, readings=late),))
    causes = [CATALOGUE[id] for id in ("armature", "delay")]
    found = diagnose(study, causes=causes, options=Options(suggest=False))

    assert bool(found.measures["own_time_step"]) is own
    values = {c.candidate.cause.id: c.parameters for c in found.causes}
    assert set(values) == {"armature", "delay"}
    assert values["delay"]["delay"].value == pytest.approx(LATE, abs=2e-4)
    assert values["armature"]["inertia"].value == pytest.approx(3.0 * NOMINAL, rel=0.01)


@pytest.mark.parametrize(("pushed", "about"), [(0.0, True), (0.1, False)])
def test_the_error_of_the_step_stays_nominal_if_causes_leave_much_else(
    tmp_path: Path, pushed: float, about: bool
) -> None:
    used = list[Replayer]()

    def keep(replayer: Replayer, *others: object) -> None:
        used.append(replayer)

    study = study_of(tmp_path, STEP / 16, 4.0 * NOMINAL, pushed)
    diagnose(study, causes=[CATALOGUE["armature"]], options=Options(suggest=False), watch=keep)

    nominal, own = used[0].step_error_of([]), used[0].step_error
    assert bool(np.any(own.drift != nominal.drift)) is about
