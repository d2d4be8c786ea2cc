"""Postures that a robot visited: what was wanted, true, estimated and seen; and the errors.

There are two definitions of error, and they need not agree. The paper's is estimate against seen,
what a real robot can measure. The true one is target against true, what only a simulation knows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats, Ints
from kengoro.hand_search import TrialOptions, find_hand
from kengoro.session import Session
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.names import GROUP_JOINTS, JOINTS

ANGLES = ("target", "true", "estimate", "seen")

ERRORS = {
    "estimate_seen": "estimate - seen (the paper's)",
    "target_true": "target - true",
    "estimate_true": "estimate - true",
    "estimate_target": "estimate - target",
}
"""Pairs of angles that are compared, and how they are called."""

Visits = dict[str, list[Any]]
"""By `ANGLES` joint angles [rad] a visit, n numbers each, "seen" None where no marker was seen; and
`max_tension` [N], `time` [s] when it ended."""


def no_visits() -> Visits:
    """Visits before the first."""
    return {key: [] for key in (*ANGLES, "max_tension", "time")}


def visit(
    session: Session,
    target: Floats,
    visits: Visits | None = None,
    move: float = 2.0,
    patience: float = 2.0,
    look: bool = True,
) -> Visits:
    """Move to a posture, come to rest, look at the hand; what was found is added to ``visits``.

    What is wanted, true and estimated is that at rest, before the head turns to find the hand and
    before the map is moved by what is seen.

    Args:
        session: of the Posture task.
        target: joint angles (n,) [rad].
        visits: what was found so far.
        move: duration of the movement [s].
        patience: longest wait for rest and a look [s].
        look: whether the head is turned where the hand is not in view.
    """
    visits = no_visits() if visits is None else visits
    log, begin, half = session.log, len(session.log.time), session.time + move / 2
    session.move(target, move, patience)
    observations = int(
        np.searchsorted(log.observation_time, half)
    )  # those before are of the posture it left
    rest = len(log.time) - 1
    if (
        len(log.observation_time) > observations
    ):  # the step before the look: learning moves estimate and arm
        rest = max(0, int(np.searchsorted(log.time, log.observation_time[observations])) - 1)
    elif look:
        find_hand(session, target, TrialOptions())
    estimate, seen = log.estimate[rest], None
    if (
        len(log.observation_time) > observations
    ):  # the head may have turned, so the error counts, not the angles
        seen = estimate - log.observation_error[observations]
    for key, angles in zip(ANGLES, (target, log.true[rest], estimate, seen), strict=True):
        visits[key].append(None if angles is None else np.round(angles, 6).tolist())
    visits["max_tension"].append(round(float(np.max(log.tensions[begin:])), 1))
    visits["time"].append(round(session.time, 2))
    return visits


def gaps(visits: Visits, pair: str) -> Floats:
    """Differences (K, n) [rad] of a pair of `ERRORS`; visits where the hand was not seen are left
    out where it is compared with."""
    one, other = pair.split("_")
    both = zip(visits[one], visits[other], strict=True)
    found = [np.subtract(a, b) for a, b in both if a is not None and b is not None]
    return np.array(found).reshape(-1, len(JOINTS))


def rmse_deg(visits: Visits, pair: str, joints: Ints | None = None) -> Floats:
    """RMSE_joint (K,) [deg] of each visit: root mean square over (some) joints."""
    gap = np.degrees(gaps(visits, pair))
    return np.sqrt(np.mean(np.square(gap if joints is None else gap[:, joints]), axis=1))


def hand_mm(visits: Visits, pair: str) -> Floats:
    """Distance_hand (K,) [mm] of each visit, between the grip points of a pair of `ERRORS`."""
    one, other = pair.split("_")
    both = zip(visits[one], visits[other], strict=True)
    found = [
        1e3 * np.linalg.norm(grip(np.array(a)) - grip(np.array(b)))
        for a, b in both
        if a is not None and b is not None
    ]
    return np.array(found, dtype=float)


def grip(q: Floats) -> Floats:
    """Grip point (3,) [m] of the drawing at joint angles (n,) [rad]."""
    return _kinematics().pose("grip", q)[:3, 3]


@cache
def _kinematics() -> ArmKinematics:
    return ArmKinematics(asset_path(ARM), JOINTS)


def group_joints() -> dict[str, Ints]:
    """Indices of all joints, and of those that each group owns."""
    own = {name: np.array([JOINTS.index(j) for j in js]) for name, js in GROUP_JOINTS.items()}
    return {"all": np.arange(len(JOINTS)), **own}


def errors(visits: Visits) -> dict[str, float]:
    """Medians over visits: ``PAIR_deg`` and ``PAIR_mm`` of all `ERRORS`, ``max_tension_N``.

    A pair that was never found, such as what is seen when nothing was, is left out.
    """
    result = {}
    for pair in ERRORS:
        angles, hands = rmse_deg(visits, pair), hand_mm(visits, pair)
        if angles.size:
            result[f"{pair}_deg"] = round(float(np.median(angles)), 4)
            result[f"{pair}_mm"] = round(float(np.median(hands)), 3)
    result["max_tension_N"] = max(visits["max_tension"])
    return result


def error_rows(columns: Mapping[str, Sequence[Mapping[str, float]]]) -> list[list[object]]:
    """Rows of a table of `errors`: for each, median (worst) over the robots of each column."""
    rows: list[list[object]] = []
    names = {f"{pair}_{unit}": f"{told} [{unit}]" for unit in ("deg", "mm")
             for pair, told in ERRORS.items()}  # fmt: skip
    for key, told in {**names, "max_tension_N": "largest tension [N]"}.items():
        cells = [_cell([e[key] for e in column if key in e]) for column in columns.values()]
        rows.append([told, *cells])
    return rows


def _cell(values: Iterable[float]) -> str:
    numbers = np.array(list(values))
    return f"{np.median(numbers):.1f} ({numbers.max():.1f})" if numbers.size else "-"
