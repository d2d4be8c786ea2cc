"""Visits of postures: target, true, estimated and observed joint angles, and their errors.

There are two definitions of error, which need not agree. The paper's is estimate against observed,
which a real robot can measure. The true one is target against true, which only a simulation knows.
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
"""Pairs of angles that are compared, with their titles in tables."""

Visits = dict[str, list[Any]]
"""A list for each key, with an entry for each visit: joint angles of each of `ANGLES` (n numbers,
[rad]; "seen" is None without a marker observation), `max_tension` [N], `time` of its end [s]."""


def no_visits() -> Visits:
    """No visits yet."""
    return {key: [] for key in (*ANGLES, "max_tension", "time")}


def visit(
    session: Session,
    target: Floats,
    visits: Visits | None = None,
    move: float = 2.0,
    patience: float = 2.0,
    search: bool = True,
) -> Visits:
    """Move to a posture, come to rest, observe the hand, and add the result to ``visits``.

    Target, true and estimated angles are those at rest, before the head turns to find the hand and
    before the observation moves the map.

    Args:
        session: of the Posture task.
        target: joint angles (n,) [rad].
        visits: what was found so far.
        move: duration of the movement [s].
        patience: longest wait for rest and an observation [s].
        search: whether the head turns to find a hand that is not in view.
    """
    visits = no_visits() if visits is None else visits
    log, begin, half = session.log, len(session.log.time), session.time + move / 2
    session.move(target, move, patience)
    # Observations before the middle of the movement are of the posture that it left.
    first = int(np.searchsorted(log.observation_time, half))
    rest = len(log.time) - 1
    if len(log.observation_time) > first:
        # The step before the observation: learning moves the estimate and the arm.
        rest = max(0, int(np.searchsorted(log.time, log.observation_time[first])) - 1)
    elif search:
        find_hand(session, target, TrialOptions())
    estimate, seen = log.estimate[rest], None
    if len(log.observation_time) > first:
        # The head may have turned since, so the error counts, not the observed angles.
        seen = estimate - log.observation_error[first]
    for key, angles in zip(ANGLES, (target, log.true[rest], estimate, seen), strict=True):
        visits[key].append(None if angles is None else np.round(angles, 6).tolist())
    visits["max_tension"].append(round(float(np.max(log.tensions[begin:])), 1))
    visits["time"].append(round(session.time, 2))
    return visits


def gaps(visits: Visits, pair: str) -> Floats:
    """Differences of a pair of `ERRORS`, shape (K, n) [rad].

    Pairs with "seen" leave out visits without a marker observation.
    """
    one, other = pair.split("_")
    both = zip(visits[one], visits[other], strict=True)
    found = [np.subtract(a, b) for a, b in both if a is not None and b is not None]
    return np.array(found).reshape(-1, len(JOINTS))


def rmse_deg(visits: Visits, pair: str, joints: Ints | None = None) -> Floats:
    """RMSE_joint of each visit, shape (K,) [deg]: root mean square over all or some joints."""
    gap = np.degrees(gaps(visits, pair))
    return np.sqrt(np.mean(np.square(gap if joints is None else gap[:, joints]), axis=1))


def hand_mm(visits: Visits, pair: str) -> Floats:
    """Distance_hand of each visit, shape (K,) [mm]: between the grip points of a pair."""
    one, other = pair.split("_")
    both = zip(visits[one], visits[other], strict=True)
    found = [
        1e3 * np.linalg.norm(grip(np.array(a)) - grip(np.array(b)))
        for a, b in both
        if a is not None and b is not None
    ]
    return np.array(found, dtype=float)


def grip(q: Floats) -> Floats:
    """Grip point of the nominal model at joint angles (n,) [rad], shape (3,) [m]."""
    return nominal_kinematics().pose("grip", q)[:3, 3]


@cache
def nominal_kinematics() -> ArmKinematics:
    """Kinematics of the nominal model of Kengoro's arm."""
    return ArmKinematics(asset_path(ARM), JOINTS)


def group_joints() -> dict[str, Ints]:
    """Indices of all joints, and of the joints of each group."""
    own = {name: np.array([JOINTS.index(j) for j in js]) for name, js in GROUP_JOINTS.items()}
    return {"all": np.arange(len(JOINTS)), **own}


def errors(visits: Visits) -> dict[str, float]:
    """Medians over visits: ``PAIR_deg`` and ``PAIR_mm`` of all `ERRORS`, ``max_tension_N``.

    A pair without any visit, such as one with "seen" when the marker was never found, is left out.
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
    """Rows of a table of `errors`: median (worst) over the robots of each column."""
    rows: list[list[object]] = []
    names = {f"{pair}_{unit}": f"{title} [{unit}]" for unit in ("deg", "mm")
             for pair, title in ERRORS.items()}  # fmt: skip
    for key, title in {**names, "max_tension_N": "largest tension [N]"}.items():
        cells = [_cell([e[key] for e in column if key in e]) for column in columns.values()]
        rows.append([title, *cells])
    return rows


def _cell(values: Iterable[float]) -> str:
    numbers = np.array(list(values))
    return f"{np.median(numbers):.1f} ({numbers.max():.1f})" if numbers.size else "-"
