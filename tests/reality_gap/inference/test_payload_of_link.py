"""A payload in the middle of a link that is as heavy as its forces are weak, without gravity."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Diagnosis, Verdict, diagnose
from reality_gap.causes import CATALOGUE, find_cause
from reality_gap.inference.paying import distance_to_bound
from reality_gap.inference.screening import list_candidates, screen
from reality_gap.inference.verdict import Options
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study

PLANAR = """<mujoco><option timestep="{step}" gravity="0 0 0"/><worldbody>
<body><joint name="inner" axis="0 0 1" damping="0.01"/>
<geom type="capsule" fromto="0 0 0 0.12 0 0" size="0.01"/>
<body name="hand" pos="0.12 0 0"><joint name="outer" axis="0 0 1" damping="0.01"/>
<geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01"/>
<geom type="sphere" pos="0.12 0 0" size="0.01"/>{ball}</body></body></worldbody>
<actuator><motor name="m_inner" joint="inner" gear="0.05"/>
<motor name="m_outer" joint="outer" gear="0.05"/></actuator>
<sensor><jointpos name="inner" joint="inner"/><jointpos name="outer" joint="outer"/></sensor>
</mujoco>"""
BALL = '<geom type="sphere" pos="{x} 0 0" size="0.001" mass="{mass}"/>'
PERIOD, COUNT, STEP, NOISE = 0.02, 500, 0.005, 3e-3
KINDS = ("payload", "link_mass", "centre_of_mass", "force_scale", "viscous_friction", "armature")


def study(folder: Path, ball: str) -> Study:
    """Return the study of a log of the arm with a ball, by the model without it."""
    path = folder / "arm.xml"
    path.write_text(PLANAR.format(step=STEP, ball=""))
    model = mujoco.MjModel.from_xml_string(PLANAR.format(step=STEP / 10, ball=ball))
    data, rng = mujoco.MjData(model), np.random.default_rng(6)
    time = PERIOD * np.arange(COUNT)
    command = 0.4 * np.column_stack(
        [np.sin(1.9 * time) + np.sin(4.1 * time), np.sin(2.7 * time + 1.0) + np.sin(5.3 * time)]
    )
    readings = np.empty((COUNT, 2))
    for k, now in enumerate(command):
        readings[k] = data.qpos
        data.ctrl[:] = now
        mujoco.mj_step(model, data, round(10 * PERIOD / STEP))
    readings += NOISE * rng.standard_normal(readings.shape)
    channels = tuple(Channel(name, name, unit="rad", noise=NOISE) for name in ("inner", "outer"))
    episode = Episode("only", time, command, tuple(Reading(time, value) for value in readings.T))
    return Study("arm", path, channels, (episode,), Initial(settle=0.0))


def diagnosis(folder: Path, ball: str) -> Diagnosis:
    causes = [CATALOGUE[id] for id in KINDS]
    return diagnose(study(folder, ball), causes=causes, options=Options(suggest=False))


def test_a_payload_anywhere_on_a_link_is_one_cause(tmp_path: Path) -> None:
    """It is as heavy as the link, 80 times what the motors' typical force suggests."""
    found = diagnosis(tmp_path, BALL.format(x=0.05, mass=0.04))

    assert found.verdict is Verdict.NAMED
    assert [str(cause.candidate) for cause in found.causes] == ["payload at hand"]
    mass, along = (found.causes[0].parameters[name] for name in ("mass", "along"))
    assert mass.low < 0.04 < mass.high
    assert mass.value == pytest.approx(0.04, rel=0.05)
    assert along.low < (0.05 - along_zero(tmp_path)) / (0.13 - along_zero(tmp_path)) < along.high


def along_zero(folder: Path) -> float:
    """Return where a payload with ``along`` 0 is: the centre of mass [m]."""
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    return float(model.body("hand").ipos[0])


def test_a_shape_is_screened_at_other_values_too(tmp_path: Path) -> None:
    with Replayer(study(tmp_path, "")) as replayer:
        candidates = list_candidates(replayer.system, [find_cause("payload")])
        found = screen(replayer, candidates, replayer.residual([]))
    assert [(one.names, one.fixed.get("along")) for one in found] == [
        (("mass", "along", "gyration"), 1.0),
        (("mass", "gyration"), 0.0),
    ]
    tip, middle = (np.linalg.norm(one.columns[:, 0]) for one in found)
    assert 0.1 * tip < middle < 0.9 * tip


def test_a_payload_as_far_away_as_can_be_stands_for_another_cause(tmp_path: Path) -> None:
    with Replayer(study(tmp_path, "")) as replayer:
        [one] = list_candidates(replayer.system, [find_cause("payload")])
        friction = list_candidates(replayer.system, [find_cause("coulomb_friction")])[0]
    least = {p.name: p.low for p in friction.parameters if p.hints.shape}

    assert distance_to_bound((one, {"mass": 0.01, "along": 3.0, "gyration": 0.0})) == 0.0
    assert distance_to_bound((one, {"mass": 0.01, "along": 1.5, "gyration": 0.0})) > 0.5
    assert least
    assert distance_to_bound((friction, friction.null_values() | least)) == 1.0
