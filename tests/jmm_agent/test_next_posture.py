"""The agent chooses where to look next, among postures that it can visit and see its hand at.

The robot is the small one of `seen_robots`, with eight muscles, and other candidates than typical
postures of an arm.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jmm_agent.command_limits import CommandLimits
from jmm_agent.errors import AgentError
from jmm_agent.next_posture import PlannerModel, PlannerState, some_of
from jmm_agent.posture_planner import (
    BEYOND,
    NOT_HELD,
    NOT_IN_VIEW,
    TOO_FAST,
    TOO_NEAR,
    PosturePlanner,
    planner_apart,
)
from jmm_agent.trajectory import Trajectory
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionUpdater
from jmm_agent.vision.observation_fit import ObservationFitOptions
from tests.jmm_agent.vision.seen_robots import (
    JOINTS,
    LEVER,
    POSITION_NOISE,
    WIDE,
    SeenRobot,
    hand_postures,
    map_of,
    picture,
    postures,
    see,
    updater,
)


class SmallArm:
    """Kinematics of the small robot: the hand moves linearly."""

    limits, joints = WIDE, JOINTS

    def pose(self, frame: str, q: Floats, relative_to: str | None = None) -> Floats:
        return picture(q)

    def frame_jacobian(self, frame: str, q: Floats, relative_to: str | None = None) -> Floats:
        return np.vstack([LEVER, np.zeros((3, 4))])


class Statics:
    """Muscles that hold no posture whose first joint is above an angle [rad]."""

    def __init__(self, highest: float) -> None:
        self.highest = highest

    def hold(self, posture: Floats) -> Any:
        held = posture[0] <= self.highest
        return SimpleNamespace(reachable=held, tension=1.0, reason="" if held else "too high")


def planner(
    vision: VisionUpdater,
    shows: Any = None,
    statics: Statics | None = None,
    rate: float = np.inf,
    here: Floats | None = None,
) -> PosturePlanner:
    """Planner by what an updater has learned."""
    model = PlannerModel(
        vision.forecast,
        SmallArm(),  # type: ignore[arg-type]
        postures(30, 60),
        shows,
        ("hand", "eye"),
        ObservationFitOptions(POSITION_NOISE, 10.0),
    )
    start = postures(1, 61)[0] if here is None else here
    state = PlannerState(map_of(vision), vision.memory, start, 0.15, 0.005, CommandLimits(rate))
    return planner_apart(model, statics, None, None, state)


def learned(observations: int = 2, seed: int = 3) -> tuple[SeenRobot, VisionUpdater]:
    robot, vision = SeenRobot(seed), updater()
    for q in postures(observations, 70 + seed):
        see(vision, robot.observation(q))
    return robot, vision


def hand_error(robot: SeenRobot, vision: VisionUpdater) -> float:
    """Root mean square of the true error of the hand over other postures [m]."""
    test = postures(60, 91)
    judged = hand_postures()._replace(postures=test, jacobians=np.tile(LEVER, (60, 1, 1)))
    rows = judged.rows(vision.forecast.prior.map, 0.001)
    off = map_of(vision).lengths(test) - robot.lengths(test)
    return float(np.sqrt(np.mean(np.sum(np.einsum("pam,pm->pa", rows, off) ** 2, axis=1))))


def test_chosen_observations_teach_more_than_random_ones() -> None:
    errors: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(10):
        others = postures(30, 800 + seed)
        for chosen, kept in errors.items():
            robot, vision = SeenRobot(seed), updater()
            for number in range(3):
                q = planner(vision).choose(others).posture if chosen else others[number]
                see(vision, robot.observation(q))
            kept.append(hand_error(robot, vision))
    gaps = np.subtract(errors[True], errors[False])
    assert np.median(errors[True]) < 0.85 * np.median(errors[False])
    assert np.mean(gaps < 0.0) >= 0.7


def test_the_posture_is_the_one_with_the_least_expected_error_and_its_reason_names_it() -> None:
    _, vision = learned()
    candidates = postures(12, 44)
    found = planner(vision).choose(candidates)
    assert np.any(np.all(candidates == found.posture, axis=1))
    singles = [planner(vision).choose(q).after for q in candidates]
    assert found.after == pytest.approx(min(singles))
    assert found.before > found.after
    assert found.in_view == 1.0
    assert f"from {1e3 * found.before:.3g} mm to {1e3 * found.after:.3g} mm" in found.reason


def test_without_candidates_some_typical_postures_are_taken() -> None:
    _, vision = learned()
    found = planner(vision).choose()
    assert np.any(np.all(postures(30, 60) == found.posture, axis=1))
    parts = [some_of(postures(30, 60), turn, 8) for turn in range(4)]
    assert sorted(len(part) for part in parts) == [7, 7, 8, 8]
    assert len(np.unique(np.vstack(parts), axis=0)) == 30


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_hand_is_looked_at_where_it_is_expected_in_view(side: float) -> None:
    """A camera that sees one side only; where the arm will rest is uncertain."""
    _, vision = learned()
    candidates = postures(24, 44)
    found = planner(vision, lambda pose: side * pose[0, 3] > 0.0).choose(candidates)
    assert side * picture(found.posture)[0, 3] > 0.0
    assert 0.5 <= found.in_view <= 1.0
    assert 0 < found.left_out[NOT_IN_VIEW] < 24
    assert "seen with a probability of" in found.reason


def test_an_unknown_robot_is_less_certainly_in_view_than_a_known_one() -> None:
    def shows(pose: Floats) -> bool:
        return bool(abs(pose[0, 3] - picture(q)[0, 3]) < 0.05)

    q = postures(1, 44)[0]
    unknown, known = updater(), learned(8)[1]
    views = [planner(vision, shows).choose(q).in_view for vision in (unknown, known)]
    assert views[0] < 0.9
    assert views[0] < views[1]


def test_a_hand_that_no_posture_shows_is_named() -> None:
    _, vision = learned()
    found = planner(vision, lambda pose: False).choose(postures(5, 44))
    assert found.in_view == 0.0
    assert found.left_out == {NOT_IN_VIEW: 5}
    assert "of no posture that can be held with a higher one" in found.reason


def test_postures_that_cannot_be_visited_are_left_out_by_reason() -> None:
    _, vision = learned()
    last = vision.memory.angles[-1]
    high, low = postures(2, 44).copy()
    high[0], low[0] = 0.7, -0.7
    beyond = low.copy()
    beyond[1] = WIDE[1, 1] + 0.01
    subject = planner(vision, statics=Statics(0.0))
    found = subject.choose([beyond, last + 0.01, high, low])
    np.testing.assert_array_equal(found.posture, low)
    assert {BEYOND: 1, TOO_NEAR: 1}.items() <= found.left_out.items()
    with pytest.raises(AgentError) as refusal:
        subject.choose([beyond, last + 0.01, high])
    for reason in (BEYOND, TOO_NEAR, NOT_HELD):
        assert f"{reason} (1)" in str(refusal.value)


def test_a_movement_takes_as_long_as_its_commands_need() -> None:
    """At that duration the fastest muscle just keeps to the rate, at any time of the movement."""
    _, vision = learned()
    here, there, rate = *postures(2, 44), 0.02
    subject = planner(vision, rate=rate, here=here)
    found = subject.choose(there)
    times = np.linspace(0.0, found.duration, 4001)
    path = Trajectory(np.array([here, there]), 0.0, found.duration)
    lengths = map_of(vision).lengths(np.array([path.at(time) for time in times]))
    fastest = np.abs(np.diff(lengths, axis=0)).max() / (times[1] - times[0])
    assert 0.8 * rate < fastest < 1.05 * rate
    with pytest.raises(AgentError, match=TOO_FAST):
        subject.choose(there, within=0.9 * found.duration)
    assert subject.choose(there, within=1.1 * found.duration).duration == found.duration


def test_a_planner_is_not_changed_by_what_is_learned_later_nor_by_a_thread() -> None:
    robot, vision = learned()
    candidates = postures(8, 44)
    expected = planner(vision).choose(candidates)
    early = planner(vision)
    see(vision, robot.observation(candidates[0]))
    with ThreadPoolExecutor(1) as pool:
        found = pool.submit(early.choose, candidates).result()
    np.testing.assert_array_equal(found.posture, expected.posture)
    assert found[1:] == expected[1:]
    assert planner(vision).choose(candidates).before < found.before


@pytest.mark.parametrize(
    ("candidates", "text"),
    [
        (np.zeros((2, 3)), r"of shape \(C, 4\), got shape \(2, 3\)"),
        (np.empty((0, 4)), "got shape"),
        ("here", "got shape"),
        (np.full((2, 4), np.nan), "must be finite"),
    ],
)
def test_what_are_no_postures_is_refused(candidates: Any, text: str) -> None:
    with pytest.raises(AgentError, match=text):
        planner(updater()).choose(candidates)


def test_a_fit_without_a_posterior_cannot_choose() -> None:
    with pytest.raises(AgentError, match="use another fit"):
        planner(updater(fit="alone")).choose(postures(3, 44))


def test_a_joint_that_would_rest_at_its_stop_is_avoided() -> None:
    """Two postures alike but for a joint at its limit, where no pair is learned."""
    _, vision = learned(6)
    inner = postures(1, 44)[0]
    outer = inner.copy()
    outer[2] = WIDE[2, 1] - 0.001
    both = [planner(vision).choose(q) for q in (outer, inner)]
    assert both[0].after < 1.5 * both[1].after  # it would tell as much, or nearly
    found = planner(vision).choose([outer, inner])
    np.testing.assert_array_equal(found.posture, inner)
