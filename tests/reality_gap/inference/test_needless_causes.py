"""A strong spring, far from what slopes at the null show: another cause is chosen first."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from reality_gap import diagnose
from reality_gap.causes import CATALOGUE
from reality_gap.inference.verdict import Options
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study

ARM = """<mujoco><option timestep="{step}"/><worldbody><body pos="0 0 1">
<joint name="shoulder" axis="0 1 0" damping="0.15" armature="0.02" {spring}/>
<geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.025" mass="1.2"/></body></worldbody>
<actuator><motor name="motor" joint="shoulder"/></actuator>
<sensor><jointpos name="angle" joint="shoulder"/></sensor></mujoco>"""
SPRING = 'stiffness="1.5" springref="17.188733853924695"'
PERIOD, COUNT, STEP, NOISE = 0.005, 1800, 0.002, 4e-4
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


@pytest.mark.slow
@pytest.mark.parametrize("far", [(0.3, 1.0), ()])
def test_a_strong_spring_that_rests_elsewhere_is_the_only_cause(
    study: Study, monkeypatch: pytest.MonkeyPatch, far: tuple[float, ...]
) -> None:
    """Its replay is a thousand noises off: either fits start far from the null, or another cause
    is chosen first, which is within its tolerance beside the spring.
    """
    monkeypatch.setattr("reality_gap.causes.joint_stiffness.FAR", far)
    causes = [CATALOGUE[id] for id in KINDS]
    found = diagnose(study, causes=causes, options=Options(suggest=False))

    assert found.verdict.has_names
    assert [cause.candidate.cause.id for cause in found.causes] == ["joint_stiffness"]
    spring = found.causes[0].parameters
    assert spring["stiffness"].value == pytest.approx(1.5, rel=0.005)
    assert spring["rest"].value == pytest.approx(0.3, abs=0.003)
