"""Statics of a nominal model: which postures its muscles can hold, and at which tensions.

Muscles only pull, with at least T_bias and at most T_max. A posture theta can be held if there are
tensions T with

    G(theta)' T = g(theta),    T_bias <= T <= T_max

with the moment arms G and the torques g of gravity and springs. Of all such tensions the linear
programme finds those with the smallest maximum.

The posture must also be stable: every small displacement d is opposed,

    d' [sum_i T_i dG_i/dtheta - dg/dtheta] d  +  K_stiff sum_i (G_i d)^2  >  0.

A muscle at T_bias has the stiffness K_stiff only where d lengthens it, so that the last sum then
has only positive G_i d. Lengths are never quite right, and an error e of all lengths changes the
tensions by K_stiff e, and so the first term by K_stiff e norm_i(d' dG_i/dtheta d), about. It must
stay positive for errors of `LENGTH_ERROR` times the muscles' travel. All is tested along the
eigenvectors of the matrix of the muscles above T_bias, in both directions. A posture that only
exact lengths hold counts as not reachable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog

from kengoro_env.errors import ArgumentError
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.types import Floats

TOLERANCE = 1e-3
"""Torque that may be missing, as a share of the largest torque of a muscle at T_bias [1]."""
PULLS = 1e-3
"""A muscle pulls with more than T_bias if it does so by this share of T_bias [1]."""
LENGTH_ERROR = 0.08
"""Error of lengths at which a posture must be stable, as a share of the muscles' travel [1]."""
STEP = 1e-4
"""Step of the derivatives by joint angles [rad]."""
MISSING = 1e4
"""Cost of missing torque against tension."""


class Hold(NamedTuple):
    """Whether the muscles can hold a posture.

    Attributes:
        reachable: whether they can, also with lengths that are wrong by `LENGTH_ERROR`.
        tension: smallest maximum of tensions that hold the posture [N]; infinite if none do.
        reason: why not, without a full stop; empty if the posture is reachable.
    """

    reachable: bool
    tension: float
    reason: str


class Statics:
    """Statics of a robot by its nominal model.

    Args:
        arm: the nominal model.
        gains: of the motors.
    """

    def __init__(self, arm: NominalArm, gains: Gains) -> None:
        self._arm, self._gains = arm, gains

    def hold(self, posture: ArrayLike) -> Hold:
        """Whether the muscles can hold a posture (module docstring).

        Args:
            posture: joint angles (n,) [rad].

        Raises:
            ArgumentError: the posture is not finite or of another shape.
        """
        q, joints, gains = np.asarray(posture, dtype=float), self._arm.joints, self._gains
        if q.shape != (len(joints),) or not np.isfinite(q).all():
            raise ArgumentError(
                f"a posture must be {len(joints)} finite angles, not an array of shape {q.shape}"
            )
        arms, load = self._arm.moment_arms(q), self._arm.gravity(q)
        tensions, missing = least_tensions(arms, load, gains.bias)
        slack = TOLERANCE * max(gains.bias * float(np.abs(arms).max()), 1e-9)
        worst = int(np.abs(missing).argmax())
        if abs(missing[worst]) > slack:
            reason = (
                f"no pull of its muscles from T_bias = {gains.bias:.3g} N on balances joint "
                f"{joints[worst]!r}, where {abs(missing[worst]):.2g} N m are missing"
            )
            return Hold(False, np.inf, reason)
        most = float(tensions.max())
        if most > gains.limit:
            muscle = self._arm.muscles[int(tensions.argmax())]
            reason = (
                f"muscle {muscle!r} would have to pull with {most:.3g} N, above the motors' limit "
                f"of {gains.limit:.3g} N"
            )
            return Hold(False, most, reason)
        joint, length = self._weakest(q, arms, tensions)
        if length < LENGTH_ERROR * self._arm.travel:
            how = "is unstable there"
            if length > 0.0:
                how = f"would be unstable there if lengths were wrong by {1e3 * length:.2g} mm"
            return Hold(False, most, f"joint {joints[joint]!r} {how}")
        return Hold(True, most, "")

    def _weakest(self, q: Floats, arms: Floats, tensions: Floats) -> tuple[int, float]:
        """The joint that leaves a posture first, and the error of lengths at which it does [m]."""
        arm, gains = self._arm, self._gains
        rows = []
        for step in STEP * np.eye(len(q)):
            turned = (arm.moment_arms(q + step) - arm.moment_arms(q - step)).T @ tensions
            rows.append((turned - arm.gravity(q + step) + arm.gravity(q - step)) / (2 * STEP))
        pulls = tensions > (1.0 + PULLS) * gains.bias
        matrix = np.array(rows) + gains.stiffness * arms[pulls].T @ arms[pulls]
        values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
        joint, least = 0, np.inf
        for value, vector in zip(values, vectors.T, strict=True):
            longer = min(
                float(np.sum(np.maximum(arms[~pulls] @ direction, 0.0) ** 2))
                for direction in (vector, -vector)
            )
            step = STEP * vector
            bends = (arm.moment_arms(q + step) - arm.moment_arms(q - step)) @ vector / (2 * STEP)
            change = gains.stiffness * float(np.linalg.norm(bends))
            length = (value + gains.stiffness * longer) / max(change, 1e-12)
            if length < least:
                joint, least = int(np.abs(vector).argmax()), length
        return joint, least


def least_tensions(arms: Floats, torque: Floats, bias: float) -> tuple[Floats, Floats]:
    """Tensions from a bias on with the smallest maximum, and the torques that they miss.

    Args:
        arms: moment arms (m, n) [m/rad].
        torque: to be balanced (n,) [N m].
        bias: least tension [N].

    Returns:
        Tensions (m,) [N], and missing torques (n,) [N m].
    """
    # The unknowns: tensions (m,), their maximum, and missing torques in both directions (n,) each.
    m, n = arms.shape
    scale = max(float(np.abs(arms).max()), 1e-12)
    found = linprog(
        np.concatenate([np.zeros(m), [1.0], np.full(2 * n, MISSING)]),
        np.hstack([np.eye(m), -np.ones((m, 1)), np.zeros((m, 2 * n))]),
        np.zeros(m),
        np.hstack([arms.T / scale, np.zeros((n, 1)), np.eye(n), -np.eye(n)]),
        torque / scale,
        [(bias, None)] * m + [(0.0, None)] * (1 + 2 * n),
        method="highs",
    )
    if not found.success:
        return np.full(m, np.inf), np.full(n, np.inf)
    return found.x[:m], scale * (found.x[m + 1 : m + 1 + n] - found.x[m + 1 + n :])
