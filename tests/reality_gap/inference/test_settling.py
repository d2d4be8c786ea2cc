"""Models that are wrong by many noises: several causes at once, none of them small."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from reality_gap import Options, Verdict, diagnose
from reality_gap.causes import CATALOGUE
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.types import Floats
from tests.reality_gap.inference.imperfect_models import SHAPES, TIME, Case

KINDS = (
    "position_gain",
    "velocity_gain",
    "command_gain",
    "coulomb_friction",
    "viscous_friction",
    "link_mass",
    "force_scale",
    "joint_stiffness",
    "encoder_scale",
    "external_force",
    "delay",
)
MODEL = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="rod">
      <joint name="axis" axis="0 1 0"/>
      <geom type="sphere" size="0.001" pos="0 0 {length}" mass="{mass}" contype="0"
            conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="axis" kp="{stiff}" kv="{damp}"/></actuator>
  <sensor><jointpos name="angle" joint="axis"/></sensor>
</mujoco>
"""
STEP = 1e-4
"""Time step of the real machine [s]."""


def pendulum(folder: Path, mass: float, length: float, seed: int) -> Study:
    """Write the study of a servo with half the stated gain, dry friction, and late commands.

    The machine is integrated here, and its clock is not regular.

    Args:
        folder: where the model is written.
        mass: of the pendulum [kg].
        length: of the pendulum [m].
        seed: of its motion, clock and noise.
    """
    rng = np.random.default_rng(seed)
    load = mass * 9.81 * length
    stiff, inertia = 0.9 * load, mass * length**2
    damp = 1.2 * np.sqrt(stiff * inertia)
    path = folder / "model.xml"
    path.write_text(MODEL.format(mass=mass, length=-length, stiff=stiff, damp=damp))
    time = np.cumsum(rng.uniform(0.003, 0.008, 1500))
    time -= time[0]
    waves = rng.uniform(0.2, 0.6, 3)[:, None] * np.sin(
        2 * np.pi * np.outer([0.15, 0.4, 0.7], time) + rng.uniform(0.0, 6.0, (3, 1))
    )
    command = waves.sum(axis=0) - waves[:, 0].sum()
    angle = np.zeros(len(time))
    now, speed, k = 0.0, 0.0, 0
    for i in range(round(time[-1] / STEP) + 1):
        t = i * STEP
        while k < len(time) and time[k] <= t:
            angle[k] = now
            k += 1
        goal = command[max(0, int(np.searchsorted(time, t - 0.012, side="right")) - 1)]
        torque = 0.5 * stiff * (goal - now) - damp * speed - load * np.sin(now)
        speed += STEP * (torque - 0.08 * load * np.tanh(speed / 0.02)) / inertia
        now += STEP * speed
    angle[k:] = now
    read = 0.0015 * np.round((angle + 2e-4 * rng.standard_normal(len(time))) / 0.0015)
    channel = Channel("angle", "angle", unit="rad", noise=5e-4)
    episode = Episode("only", time, command[:, None], (Reading(time, read),))
    return Study("pendulum", path, (channel,), (episode,), Initial(settle=0.0))


@pytest.mark.parametrize(
    ("mass", "length", "seed"),
    [
        pytest.param(0.5, 0.1, 0, marks=pytest.mark.slow),
        pytest.param(0.5, 0.1, 1, marks=pytest.mark.slow),
        pytest.param(0.02, 0.03, 2, marks=pytest.mark.slow),
        pytest.param(40.0, 0.6, 3, marks=pytest.mark.slow),
    ],
)
def test_a_halved_gain_is_named_beside_friction_and_delay(
    tmp_path: Path, mass: float, length: float, seed: int
) -> None:
    study = pendulum(tmp_path, mass, length, seed)
    chosen = [CATALOGUE[id] for id in KINDS]

    found = diagnose(study, causes=chosen, options=Options(suggest=False))

    assert found.verdict in (Verdict.NAMED, Verdict.PARTLY_NAMED)
    sizes = {c.candidate.cause.id: c.parameters for c in found.causes}
    assert sizes["position_gain"]["excess"].value == pytest.approx(-0.5, abs=0.1)
    assert "external_force" not in sizes
    assert found.rms_before > 50.0
    assert found.rms_after < 0.3 * found.rms_before


@pytest.mark.parametrize("size", [0.0, 1.0, 30.0])
def test_the_likelihood_is_that_of_the_likeliest_variance(tmp_path: Path, size: float) -> None:
    tolerances: Floats = 0.5 * SHAPES[:, :2]
    case = Case(tmp_path, size * SHAPES[:, 3] + 2.0 * SHAPES[:, 0], [])
    problem = case.problem_with(tolerances).widened(case.null)
    use, model = case.learned, problem.noise_model

    assert model.variance[0] == pytest.approx(max(1.0, 1.0 + size**2), rel=0.15)
    covariance = np.diag(model.variance[use]) + tolerances[use] @ tolerances[use].T
    expected = multivariate_normal(cov=covariance).logpdf(case.null[use])
    constant = -0.5 * np.count_nonzero(use) * np.log(2 * np.pi)
    assert model.log_likelihood(case.null) == pytest.approx(expected - constant, abs=1e-6)


def test_the_variance_is_the_likeliest(tmp_path: Path) -> None:
    case = Case(tmp_path, 10.0 * SHAPES[:, 3] + 20.0 * SHAPES[:, 0], [])
    model = case.problem_with(3.0 * SHAPES[:, :2]).widened(case.null).noise_model
    assert len(TIME) == len(model.variance)

    def likelihood(factor: float) -> float:
        other = model.variance * factor
        return type(model)(model.measured, model.tolerances, other, other).log_likelihood(case.null)

    assert max((0.8, 0.9, 1.0, 1.1, 1.25), key=likelihood) == 1.0


def test_channels_that_are_wrong_smoothly_count_like_others(tmp_path: Path) -> None:
    """The first channel has white errors, the second one half a wave."""
    study = pendulum(tmp_path, 0.5, 0.1, 0)
    [episode] = study.episodes
    names = ("white", "smooth")
    channels = tuple(replace(study.channels[0], name=name) for name in names)
    both = replace(episode, readings=2 * episode.readings)
    with Replayer(replace(study, channels=channels, episodes=(both,))) as replayer:
        time = replayer.measured.time
        white = 30.0 * np.random.default_rng(0).standard_normal(len(time))
        wave = 30.0 * np.sin(np.pi * time / time.max())
        error = np.where(replayer.measured.channel == 0, white, wave)
        model = independent_noise(replayer.measured, np.zeros((len(time), 0)))
        problem = Problem(replayer, error, model).inflated(error)

    apart = problem.noise_model.correlation
    alike = problem.without_tolerances().noise_model.correlation

    assert apart.max() > 10.0 * apart.min()
    assert np.ptp(alike) < 1e-9
    assert np.sum(1.0 / alike) == pytest.approx(np.sum(1.0 / apart), rel=0.01)
