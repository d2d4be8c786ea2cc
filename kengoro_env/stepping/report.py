"""What a control step returns: the observation, the truth, and what tasks need for the reward."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot.body import Body
from kengoro_env.spaces import LengthBounds
from kengoro_env.stepping.tracked_object import ObjectState, TrackedObject
from kengoro_env.types import Floats

Observation = dict[str, Any]
Latest = dict[str, NDArray[Any]]


class Report(NamedTuple):
    """State of a robot after a control step; of many robots with a leading axis of robots.

    Attributes:
        observation: ``lengths`` (m,) [m] and ``tensions`` (m,) [N] as sensed, within bounds.
        truth: entries of ``info``: ``joint_angles`` (n,) [rad], ``hand_pose`` (4, 4),
            ``slack_paid_out`` and ``slack_target`` (m,) [m], ``time`` [s].
        error: mean square error of the joint angles [rad^2], float or (count,); 0 without a goal.
        tension: mean tension of the muscles [N], float or (count,).
        object_state: state of the object that the hand is to lift; None without an object.
    """

    observation: Observation
    truth: dict[str, Any]
    error: Any
    tension: Any
    object_state: ObjectState | None = None


def latest_results(count: int, muscles: int, joints: int) -> Latest:
    """Arrays for the latest results of many robots, by name, with a leading axis of robots.

    They are the entries of `Report` but for the object. Rows of robots that do not move, or that
    diverge, stay as they are.
    """
    of_muscles = ("lengths", "tensions", "slack_paid_out", "slack_target")
    return {
        **{name: np.zeros((count, muscles)) for name in of_muscles},
        "joint_angles": np.zeros((count, joints)),
        "hand_pose": np.tile(np.eye(4), (count, 1, 1)),
        **{name: np.zeros(count) for name in ("error", "tension", "time")},
    }


def reach_results(count: int, joints: int) -> Latest:
    """Further arrays with which steps judge many robots that reach joint angles.

    They are ``reward`` and ``success`` (count,), and ``due`` (count,), whether the time of the next
    target has come; 0 for robots that do not move or that diverge. Steps read ``target``
    (count, n), the joint angles to reach [rad], and ``until`` (count,), the time of the next target
    [s].
    """
    return {
        "target": np.zeros((count, joints)),
        "until": np.full(count, np.inf),
        "reward": np.zeros(count),
        **{name: np.zeros(count, dtype=bool) for name in ("success", "due")},
    }


def object_results(count: int) -> Latest:
    """Further arrays for the states of the objects of many robots, see `ObjectState`."""
    return {
        "object_pose": np.tile(np.eye(4), (count, 1, 1)),
        **{name: np.zeros(count) for name in ("distance", "touched")},
    }


def measured_report(
    body: Body,
    bounds: LengthBounds,
    goals: Floats | None,
    tracked: TrackedObject | None = None,
) -> Report:
    """Measure a robot, or many robots, with NumPy.

    Args:
        body: a robot, or many robots of one model.
        bounds: bounds of the sensed lengths and tensions.
        goals: joint angles to reach, (n,) or (count, n) [rad]; None: no goal.
        tracked: the object that the hand of a single robot is to lift.
    """
    now = body.measure()
    error: Any = 0.0
    if goals is not None:
        off = now.joint_angles - goals
        error = mean(off * off)
    lengths, tensions = body.read_sensors(now)
    lengths = np.maximum(lengths, bounds.low)
    np.minimum(lengths, bounds.high, out=lengths)
    slack_paid_out, slack_target = body.slack(body.target, now)
    return Report(
        {"lengths": lengths, "tensions": np.minimum(tensions, bounds.most_tension)},
        {
            "joint_angles": now.joint_angles,
            "hand_pose": body.site_pose("grip"),
            "slack_paid_out": slack_paid_out,
            "slack_target": slack_target,
            "time": body.time,
        },
        error,
        mean(now.tensions),
        None if tracked is None else tracked.observe(body.data),
    )


def mean(values: Floats) -> Any:
    """Mean along the last axis, a float of one axis; summed in the order of control_step.c."""
    total = np.add.accumulate(values, -1)[..., -1] / values.shape[-1]
    return total if values.ndim > 1 else float(total)
