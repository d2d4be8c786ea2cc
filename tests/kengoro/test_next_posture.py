"""An agent of Kengoro's arm chooses where to look, with its own and with another camera."""

from __future__ import annotations

from dataclasses import replace
from time import process_time

import numpy as np
import pytest

from jmm_agent.command_limits import CommandLimits
from jmm_agent.errors import AgentError
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.options import AgentOptions
from jmm_agent.posture_planner import NOT_IN_VIEW
from kengoro.agents import make_agent
from kengoro.robots import CAMERA
from kengoro.trained_maps import trained_map
from kengoro_env.postures import posture_set

CHOICE = 0.5
"""Time that a choice may take on one core [s]."""


@pytest.fixture(scope="module")
def nominal_map(request: pytest.FixtureRequest) -> JointMuscleMap:
    """Trained once and kept between test runs."""
    return trained_map(request.config.cache.mkdir("maps"))


def test_an_agent_that_knows_its_drawing_only_chooses_within_half_a_second(
    nominal_map: JointMuscleMap,
) -> None:
    agent, candidates = make_agent(1, jmm=nominal_map), posture_set()[:48]
    agent.next_posture(candidates[:2])
    begin = process_time()
    found = agent.next_posture(candidates)
    assert process_time() - begin < CHOICE
    assert np.any(np.all(candidates == found.posture, axis=1))
    assert found.in_view >= 0.5
    assert found.after < found.before
    assert not agent.reachable(found.posture)[0].reason


def test_a_camera_with_a_narrower_view_leaves_out_more_postures(
    nominal_map: JointMuscleMap,
) -> None:
    narrow = replace(CAMERA, fx=2.0 * CAMERA.fx, fy=2.0 * CAMERA.fy)
    counts, views = [], []
    for camera in (CAMERA, narrow):
        agent = make_agent(1, jmm=nominal_map, camera=camera)
        found = agent.next_posture(posture_set()[:24])
        counts.append(found.left_out.get(NOT_IN_VIEW, 0))
        views.append(found.in_view)
    assert counts[1] > counts[0]
    assert views[1] < 1.0


def test_a_hand_that_no_camera_sees_is_measured_at_any_posture(nominal_map: JointMuscleMap) -> None:
    agent = make_agent(1, jmm=nominal_map, options=AgentOptions(camera=""))
    found = agent.next_posture(posture_set()[:12])
    assert found.in_view == 1.0
    assert "probability" not in found.reason


def test_slow_commands_take_longer(nominal_map: JointMuscleMap) -> None:
    agent, candidates = make_agent(1, jmm=nominal_map), posture_set()[:12]
    quick = agent.next_posture(candidates).duration
    agent.limits = CommandLimits(0.02)
    slow = agent.next_posture(candidates).duration
    assert 0.1 < quick < slow
    with pytest.raises(AgentError, match="not reached slowly enough in the time that is given"):
        agent.next_posture(candidates, within=0.01)
