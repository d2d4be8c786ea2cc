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
from reality_gap.simulation.replay_warnings import replay_warnings
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.types import Floats

SWING = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step}" integrator="Euler"/>
  <worldbody>
    <body name="link">
      <joint name="hinge" axis="0 1 0" stiffness="{stiffness}" damping="{damping}"
        limited="{stops}" range="-0.3 0.3"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="{mass}"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="hinge"/></actuator>
  <sensor><jointpos name="angle" joint="hinge"/></sensor>
</mujoco>
"""
STEP, PERIOD, SECONDS, FINE = 0.016, 0.032, 8.0, 1.0 / 64.0
LINK = {"stiffness": 1.0, "damping": 0.02, "stops": "true", "mass": 0.5}
"""Link that hits its stops, where an error of the step is not in proportion to it."""


def log(step: float, link: dict[str, object]) -> tuple[Floats, Floats, Floats]:
    """Simulate a link; return times (n,), commands (n, 1) and angles (n,)."""
    model = mujoco.MjModel.from_xml_string(SWING.format(step=step, **link))
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


def study_of(
    folder: Path,
    share: float,
    noise: float,
    link: dict[str, object] = LINK,
    **actual: object,
) -> Study:
    """Study of a log that was simulated with a share of the step, of a link that differs."""
    path = folder / "swing.xml"
    path.write_text(SWING.format(step=STEP, **link))
    time, command, angle = log(share * STEP, link | actual)
    noisy = angle + noise * np.random.default_rng(0).standard_normal(len(angle))
    channel = Channel("angle", "angle", unit="rad", noise=noise)
    episode = Episode("swing", time, command, (Reading(time, noisy),))
    return Study("swing", path, (channel,), (episode,), Initial(settle=0.0))


@pytest.mark.parametrize(("noise", "step"), [(1e-3, 1.0), (3e-4, 0.5), (1e-4, 0.25)])
def test_a_step_with_an_error_of_many_noises_is_refined(
    tmp_path: Path, noise: float, step: float
) -> None:
    replayer = Replayer(study_of(tmp_path, FINE, noise))

    assert replayer.step == step
    assert replayer.system.model.opt.timestep == pytest.approx(STEP * step)
    assert (replayer.model_error is None) is (step == 1.0)
    assert np.sqrt(np.mean((replayer.drift_curvature / noise) ** 2)) < 25.0


@pytest.mark.parametrize("actual", [{}, {"damping": 0.03}, {"mass": 0.52}])
def test_a_log_with_the_step_of_the_model_is_replayed_with_it(
    tmp_path: Path, actual: dict[str, object]
) -> None:
    replayer = Replayer(study_of(tmp_path, 1.0, 3e-4, **actual))

    assert replayer.step == 1.0


@pytest.mark.parametrize("damping", [0.03, 0.012])
@pytest.mark.parametrize("share", [1.0, FINE])
def test_an_error_in_proportion_to_the_step_is_extrapolated_away(
    tmp_path: Path, share: float, damping: float
) -> None:
    """Without stops the error is 70 noises, and damping changes the readings as it does."""
    link = {**LINK, "stiffness": 4.0, "stops": "false"}
    study = study_of(tmp_path, share, 3e-4, link, damping=damping)
    causes = [CATALOGUE[id] for id in ("viscous_friction", "joint_offset", "armature")]

    assert Replayer(study).step == 1.0
    found = diagnose(study, causes=causes, options=Options(suggest=False))

    assert [cause.candidate.cause.id for cause in found.causes] == ["viscous_friction"]
    value = found.causes[0].parameters["damping"].value
    assert value == pytest.approx(damping - 0.02, rel=0.15)


def test_a_model_that_diverges_at_its_own_step_only_is_replayed_with_a_finer_one(
    tmp_path: Path,
) -> None:
    """The integration of a spring is stable while its angular frequency is below 2 / h."""
    link = {**LINK, "stops": "false", "stiffness": (2.5 / STEP) ** 2 * 0.0154}
    study = study_of(tmp_path, FINE, 3e-4, link)

    assert not np.isfinite(Replayer(study, step=1.0).replay([]).prediction).all()
    assert Replayer(study).step == 0.5
    assert replay_warnings(study) == [
        "the model diverges with its time step of 16 ms; replays have 8 ms"
    ]


def test_processes_have_the_same_step(tmp_path: Path) -> None:
    study = study_of(tmp_path, FINE, 3e-4)
    alone = Replayer(study)

    with Replayer(study, jobs=2) as replayer:
        found = replayer.residuals([[], []])

    assert replayer.step == 0.5
    np.testing.assert_array_equal(found[0], alone.residual([]))


def test_a_check_names_the_error_of_the_model_and_the_step_of_replays(tmp_path: Path) -> None:
    study = study_of(tmp_path, FINE, 3e-4)
    error = Replayer(study, step=1.0).step_error

    [sentence] = replay_warnings(study)

    size = float(np.sqrt(np.mean((error.drift[study.episodes[0].time <= 5.0] / 3e-4) ** 2)))
    assert f"the model's time step of 16 ms changes angle by {size:.2g} times" in sentence
    assert sentence.endswith("(replays have 8 ms)")


@pytest.mark.usefixtures("no_figures")
def test_a_heavier_link_is_found_although_the_step_is_too_coarse(tmp_path: Path) -> None:
    study = study_of(tmp_path, FINE, 3e-4, mass=0.6)
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
