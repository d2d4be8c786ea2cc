"""Feedback of the posture: what friction and loads leave goes away, within limits."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.commander import Commander
from jmm_agent.errors import AgentError
from jmm_agent.posture_feedback import FADES, FeedbackOptions, PostureFeedback
from tests.jmm_agent.small_map import make_map

PERIOD = 0.02


class StickyJoint:
    """A joint that follows commands but for dry friction, and for a spring that pulls it away."""

    def __init__(self, sticks: float, pulled: float) -> None:
        self.angle, self._sticks, self._pulled = 0.0, sticks, pulled

    def follow(self, command: float) -> None:
        wanted = command - self._pulled
        self.angle += float(np.sign(wanted - self.angle)) * max(
            abs(wanted - self.angle) - self._sticks, 0.0
        )


@pytest.mark.parametrize(("sticks", "pulled"), [(0.03, 0.0), (0.0, 0.1), (0.02, -0.08)])
@pytest.mark.parametrize("period", [0.005, 0.05])
def test_a_joint_comes_to_its_target(sticks: float, pulled: float, period: float) -> None:
    feedback, joint = PostureFeedback(1, FeedbackOptions()), StickyJoint(sticks, pulled)
    joint.follow(0.5)
    before = abs(0.5 - joint.angle)
    for _ in range(round(6.0 / period)):
        feedback.advance(period, np.array([0.5 - joint.angle]))
        joint.follow(0.5 + float(feedback.correction[0]))
    assert abs(0.5 - joint.angle) < 0.1 * before


def test_what_holds_the_arm_is_pulled_no_harder_than_the_limit_allows() -> None:
    feedback = PostureFeedback(2, FeedbackOptions(most=0.2))
    for _ in range(2000):
        feedback.advance(PERIOD, np.array([0.4, -0.01]))
    assert feedback.correction[0] == pytest.approx(0.2)
    for _ in range(200):  # let go
        feedback.advance(PERIOD, np.zeros(2))
    assert feedback.correction[0] <= 0.2


def test_a_short_slide_beside_hinges_is_sent_no_farther_than_its_range() -> None:
    feedback = PostureFeedback(2, FeedbackOptions(), np.array([1.5, 0.04]))
    for _ in range(2000):
        feedback.advance(PERIOD, np.array([0.4, 0.02]))
    np.testing.assert_allclose(feedback.correction, [0.3, 0.04])
    for _ in range(round(3.0 / PERIOD)):  # nothing is wound up beyond it
        feedback.advance(PERIOD, np.array([0.0, -0.02]))
    assert feedback.correction[1] < 0.0


def test_a_correction_does_not_jump_and_fades_in_a_movement() -> None:
    feedback = PostureFeedback(1, FeedbackOptions())
    feedback.advance(PERIOD, np.array([0.1]))
    assert 0.0 < feedback.correction[0] < 0.03
    for _ in range(100):
        feedback.advance(PERIOD, np.array([0.1]))
    before = feedback.correction
    for _ in range(round(FADES / PERIOD)):
        feedback.advance(PERIOD, None)
    np.testing.assert_allclose(feedback.correction, before / np.e, rtol=1e-6)
    feedback.reset()
    assert not feedback.correction.any()


@pytest.mark.parametrize("option", ["share", "gain", "most"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan])
def test_options_must_be_positive(option: str, value: float) -> None:
    with pytest.raises(AgentError, match=f"FeedbackOptions: {option} is .* must be positive"):
        FeedbackOptions(**{option: value})


def test_commands_move_by_the_correction_once_the_movement_has_ended() -> None:
    jmm = make_map()
    joints = len(jmm.joints)
    limits = np.column_stack([-np.ones(joints), np.ones(joints)])
    commander = Commander(jmm, np.zeros(joints), limits, 0.03)
    commander.feedback = PostureFeedback(joints, FeedbackOptions())
    here, target = np.full(joints, 0.1), np.full(joints, 0.15)
    commander.start(here, 0.0, jmm.lengths(here))
    commander.go(target[None], 0.5)
    lengths = jmm.lengths(here)
    for step in range(1, 100):
        passed = commander.advance(PERIOD * step)
        command = commander.command(jmm, None, lengths, passed, here=here)
        if not commander.ended:
            assert not commander.feedback.correction.any()
    assert (commander.feedback.correction > 0.05).all()
    np.testing.assert_allclose(command, jmm.lengths(target + commander.feedback.correction))
    commander.command(jmm, None, lengths, 10.0 * FADES, here=None)  # not believed
    assert np.abs(commander.feedback.correction).max() < 1e-4


@pytest.mark.parametrize("options", [None, FeedbackOptions(gain=0.5), FeedbackOptions(most=0.02)])
def test_commands_do_not_jump_when_it_is_set_at_rest(options: FeedbackOptions | None) -> None:
    jmm = make_map()
    limits = np.column_stack([-np.ones(len(jmm.joints)), np.ones(len(jmm.joints))])
    here = np.full(len(jmm.joints), 0.1)
    feedback = PostureFeedback(len(here), FeedbackOptions())
    commander = Commander(jmm, here, limits, 0.03)
    commander.feedback = feedback
    commander.start(here, 0.0, jmm.lengths(here))
    commands = []
    for step in range(1, 301):
        if step == 200:
            feedback.options = options
        passed = commander.advance(PERIOD * step)
        commands.append(commander.command(jmm, None, jmm.lengths(here), passed, here=here - 0.05))
    moved = np.abs(np.diff(commands, axis=0)).max(axis=1)
    whole = np.abs(commands[198] - jmm.lengths(here)).max()
    assert moved[198:].max() < 0.25 * whole
    if options is None:
        np.testing.assert_allclose(commands[-1], jmm.lengths(here), atol=0.05 * whole)


@pytest.mark.parametrize("damping", [0.1, 0.2])
@pytest.mark.parametrize("frequency", [1.0, 2.0])
@pytest.mark.parametrize("period", [0.005, 0.05])
def test_an_arm_with_little_damping_comes_to_rest(
    damping: float, frequency: float, period: float
) -> None:
    feedback, angle, speed, stiff = (
        PostureFeedback(1, FeedbackOptions()),
        0.1,
        0.0,
        6.28 * frequency,
    )
    step, angles = 0.0005, []
    for _ in range(round(40.0 / period)):
        feedback.advance(period, np.array([-angle]))
        for _ in range(round(period / step)):
            command = 0.1 + float(feedback.correction[0])
            speed += step * (stiff**2 * (command - angle) - 2.0 * damping * stiff * speed)
            angle += step * speed
        angles.append(angle)
    assert np.abs(angles).max() < 0.5
    assert np.abs(angles[-round(5.0 / period) :]).max() < 0.01


def test_a_joint_is_not_commanded_beyond_its_stop() -> None:
    jmm = make_map()
    joints = len(jmm.joints)
    commander = Commander(jmm, np.ones(joints), np.tile([-1.0, 1.0], (joints, 1)), 0.03)
    commander.feedback = PostureFeedback(joints, FeedbackOptions())
    here = np.full(joints, 0.9)
    commander.start(here, 0.0, jmm.lengths(here))
    commander.go(np.ones((1, joints)), 0.1)
    for step in range(1, 50):
        passed = commander.advance(PERIOD * step)
        command = commander.command(jmm, None, jmm.lengths(here), passed, here=here)
    assert (commander.feedback.correction > 0.05).all()
    np.testing.assert_allclose(command, jmm.lengths(np.ones(joints)))
