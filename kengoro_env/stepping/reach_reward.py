"""Reward and success of reaching joint angles, which control_step.c computes with the same bits."""

from __future__ import annotations

from math import exp, radians, sqrt

TOLERANCE = radians(5.0)
"""Error of a success [rad]."""

REWARD_SCALE = radians(20.0)
EFFORT, EFFORT_SCALE = 0.05, 500.0


def judged(square: float, tension: float) -> tuple[float, bool]:
    """Reward and success.

    Python's exponential is used everywhere, which is that of C, because NumPy's has other bits.

    Args:
        square: mean square error of the joint angles [rad^2].
        tension: mean tension of the muscles [N].
    """
    error = sqrt(square)
    effort = min(tension / EFFORT_SCALE, 1.0)
    return exp(-error / REWARD_SCALE) - EFFORT * effort, error < TOLERANCE


def layout() -> dict[str, float]:
    """Values of the fields of ``Step`` in control_step.c."""
    return {
        "tolerance": TOLERANCE,
        "reward_scale": REWARD_SCALE,
        "effort": EFFORT,
        "effort_scale": EFFORT_SCALE,
    }
