"""Time steps that are too coarse: replays have finer ones, unless the log has the model's own."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Options, Verdict, diagnose, load_posterior
from reality_gap.causes import CATALOGUE
from reality_gap.report.files import write_diagnosis
from reality_gap.report.html import page
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.types import Floats

SWING = """
<mujoco>
  <option timestep="{step}" integrator="Euler"/>
  <worldbody>
    <body name="link">
      <joint name="hinge" axis="0 1 0" stiffness="4" damping="0.02"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="{mass}"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="hinge"/></actuator>
  <sensor><jointpos name="angle" joint="hinge"/></sensor>
</mujoco>
"""
STEP, PERIOD, SECONDS = 0.016, 0.032, 8.0


def log(step: float, mass: float = 0.5) -> tuple[Floats, Floats, Floats]:
    """Simulate a link on a spring; return times (n,), commands (n, 1) and angles (n,)."""
    model = mujoco.MjModel.from_xml_string(SWING.format(step=step, mass=mass))
    data = mujoco.MjData(model)
    time = PERIOD * np.arange(round(SECONDS / PERIOD))
    command = 2.0 * np.sin(4.0 * time) + 0.7 * np.sin(9.0 * time)
    angle = np.empty(len(time))
    for k, now in enumerate(command):
        mujoco.mj_forward(model, data)
        angle[k] = data.qpos[0]
        data.ctrl[:] = now
        mujoco.mj_step(model, data, round(PERIOD / step))
    return time, command[:, None], angle


def study_of(folder: Path, step: float, noise: float, mass: float = 0.5) -> Study:
    """Study of a log that was simulated with a step, with a model whose step is `STEP`."""
    path = folder / "swing.xml"
    path.write_text(SWING.format(step=STEP, mass=0.5))
    time, command, angle = log(step, mass)
    noisy = angle + noise * np.random.default_rng(0).standard_normal(len(angle))
    channel = Channel("angle", "angle", unit="rad", noise=noise)
    episode = Episode("swing", time, command, (Reading(time, noisy),))
    return Study("swing", path, (channel,), (episode,), Initial(settle=0.0))


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize(("noise", "step"), [(1e-2, 1.0), (3e-4, 0.5), (1e-5, 0.25)])
def test_a_step_with_an_error_of_many_noises_is_refined(
    tmp_path: Path, noise: float, step: float
) -> None:
    replayer = Replayer(study_of(tmp_path, STEP / 64, noise))

    assert replayer.step == step
    assert replayer.system.model.opt.timestep == pytest.approx(STEP * step)
    assert (rms(replayer.model_drift) > 50.0 * noise) is (step < 1.0)


@pytest.mark.parametrize("noise", [3e-4, 1e-5])
def test_a_log_with_the_step_of_the_model_is_replayed_with_it(tmp_path: Path, noise: float) -> None:
    replayer = Replayer(study_of(tmp_path, STEP, noise))

    assert rms(replayer.model_drift) > 50.0 * noise
    assert replayer.step == 1.0


def test_a_heavier_link_is_found_although_the_step_is_too_coarse(tmp_path: Path) -> None:
    study = study_of(tmp_path, STEP / 64, 3e-4, mass=0.6)
    causes = [CATALOGUE[id] for id in ("link_mass", "joint_offset", "joint_stiffness")]

    found = diagnose(study, causes=causes, options=Options(suggest=False))

    assert found.verdict in (Verdict.NAMED, Verdict.PARTLY_NAMED)
    assert [cause.candidate.cause.id for cause in found.causes] == ["link_mass"]
    assert found.causes[0].parameters["mass"].value == pytest.approx(0.1, rel=0.1)
    assert found.measures["time_step"] == 0.5
    assert "Replays and the extended model have 0.5 of this step" in page(found, study)
    extended = mujoco.MjModel.from_xml_string(found.extended_xml)
    assert extended.opt.timestep == pytest.approx(0.5 * STEP)
    write_diagnosis(found, study, tmp_path / "out")
    [own], [loaded] = found.sample(1), load_posterior(tmp_path / "out").sample(1)
    assert own.spec.to_xml() == loaded.spec.to_xml()
