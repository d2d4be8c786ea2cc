"""A strong spring, far from what slopes at the null show: another cause is chosen first."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from reality_gap import diagnose
from reality_gap.causes import CATALOGUE
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import list_candidates
from reality_gap.inference.settling import without_needless
from reality_gap.inference.theta import to_theta
from reality_gap.inference.verdict import Options
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study

ARM = """<mujoco><option timestep="{step}"/><worldbody><body pos="0 0 1">
<joint name="shoulder" axis="0 1 0" damping="0.15" armature="0.02" {spring}/>
<geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.025" mass="1.2"/></body></worldbody>
<actuator><motor name="motor" joint="shoulder"/></actuator>
<sensor><jointpos name="angle" joint="shoulder"/></sensor></mujoco>"""
SPRING = 'stiffness="1.5" springref="17.188733853924695"'
PERIOD, COUNT, STEP, NOISE = 0.005, 2400, 0.002, 4e-4
KINDS = (
    "joint_stiffness",
    "force_scale",
    "armature",
    "payload",
    "viscous_friction",
    "force_offset",
)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Return the study of a log of the arm with a spring, by the model without it."""
    path = tmp_path_factory.mktemp("arm") / "arm.xml"
    path.write_text(ARM.format(step=STEP, spring=""))
    model = mujoco.MjModel.from_xml_string(ARM.format(step=STEP / 20, spring=SPRING))
    data, rng = mujoco.MjData(model), np.random.default_rng(2)
    time = PERIOD * np.arange(COUNT)
    goal = 0.8 * np.sin(1.1 * time) + 0.4 * np.sin(3.7 * time + 0.4)
    angle, command = np.empty(COUNT), np.empty(COUNT)
    for k in range(COUNT):
        angle[k] = data.qpos[0]
        command[k] = data.ctrl[0] = 25.0 * (goal[k] - angle[k]) - 1.5 * data.qvel[0]
        mujoco.mj_step(model, data, round(20 * PERIOD / STEP))
    reading = Reading(time, angle + NOISE * rng.standard_normal(COUNT))
    episode = Episode("only", time, command[:, None], (reading,))
    channels = (Channel("angle", "angle", unit="rad", noise=NOISE),)
    return Study("arm", path, channels, (episode,), Initial(settle=0.0))


def test_a_strong_spring_that_rests_elsewhere_is_the_only_cause(study: Study) -> None:
    """Its replay is a thousand noises off; beside the spring, a force scale is within tolerance."""
    causes = [CATALOGUE[id] for id in KINDS]
    found = diagnose(study, causes=causes, options=Options(suggest=False))

    assert found.verdict.has_names
    assert [cause.candidate.cause.id for cause in found.causes] == ["joint_stiffness"]
    spring = found.causes[0].parameters
    assert spring["stiffness"].value == pytest.approx(1.5, rel=0.005)
    assert spring["rest"].value == pytest.approx(0.3, abs=0.003)


def test_a_cause_within_its_tolerance_beside_a_later_one_is_left_out(study: Study) -> None:
    with Replayer(study) as replayer:
        null = replayer.residual([])
        none = np.zeros((len(null), 0))
        problem = Problem(replayer, null, independent_noise(replayer.measured, none))
        spring = candidate(replayer, "joint_stiffness"), {"stiffness": 1.5, "rest": 0.3}
        scale = candidate(replayer, "force_scale")
        slight, large = (scale, {"excess": 0.003}), (scale, {"excess": 0.3})
        fits = [made(problem, [first, spring]) for first in (slight, large)]
        found = without_needless([problem, problem], fits)

    assert [one.cause.id for one in found[0].candidates] == ["joint_stiffness"]
    assert found[1] is fits[1]


def candidate(replayer: Replayer, id: str) -> Candidate:
    return list_candidates(replayer.system, [CATALOGUE[id]])[0]


def made(problem: Problem, hypothesis: Hypothesis) -> Fit:
    """Return a fit that has these values."""
    residual, theta = problem.replayer.residual(hypothesis), to_theta(hypothesis)
    return Fit(hypothesis, residual, np.zeros((len(residual), len(theta))), theta, 1.0)
