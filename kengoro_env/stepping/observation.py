"""What is observed of a robot, and the truth about it, of one or of many at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from kengoro_env.robot.body import Body, Moment
from kengoro_env.spaces import LengthBounds
from kengoro_env.types import Floats

Observation = dict[str, Any]


def felt(body: Body, now: Moment, bounds: LengthBounds) -> Observation:
    """What is observed of any robot, or of many at once: lengths and tensions, within bounds."""
    lengths, tensions = body.sense(now)
    lengths = np.maximum(lengths, bounds.low)
    np.minimum(lengths, bounds.high, out=lengths)
    return {"lengths": lengths, "tensions": np.minimum(tensions, bounds.most_tension)}


def known(body: Body, now: Moment) -> dict[str, Any]:
    """What ``info`` says of the state of any robot, or of many at once."""
    paid_out, target = body.slack(body.target, now)
    return {
        "joint_angles": now.joint_angles,
        "hand_pose": body.site_pose("grip"),
        "slack_paid_out": paid_out,
        "slack_target": target,
    }


def mean(values: Floats) -> Floats:
    """Mean along the last axis, summed from the first entry to the last, as compiled code does."""
    total: Floats = np.add.accumulate(values, -1)[..., -1]
    return total / values.shape[-1]
