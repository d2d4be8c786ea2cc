"""Errors and roughness of moment arms along sweeps of the joints.

Roughness has two measures, relative to the true moment arms: the root mean square of the second
derivative along the sweep, and the number of turns, where the moment arm reverses its direction.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from experiments.muscle_jacobian.moment_arms import KINDS, STEP, TRUE, Curves
from jmm_agent.types import Floats

ALL = "all"

TURN = 1.0
"""Change in the opposite direction that makes a turn [mm/rad]."""

Measures = dict[str, dict[str, dict[str, float]]]
"""By kind (`KINDS` and `TRUE`), then group (or `ALL`): ``error`` RMS [mm/rad] (not of `TRUE`),
``bend`` RMS of the second derivative [mm/rad^3], ``turns`` per sweep and muscle."""


def measures(found: Iterable[Curves]) -> Measures:
    """Errors and roughness, by kind and group."""
    sums: dict[tuple[str, str], list[Floats]] = defaultdict(list)
    for curves in found:
        for kind in (*KINDS, TRUE):
            sums[kind, curves.group].append(_sums(curves.arms[kind], curves.arms[TRUE]))
    result: Measures = {}
    for kind in (*KINDS, TRUE):
        by_group = {g: np.sum(parts, axis=0) for (k, g), parts in sums.items() if k == kind}
        by_group[ALL] = np.sum(list(by_group.values()), axis=0)
        result[kind] = {group: _means(total, kind) for group, total in by_group.items()}
    return result


def _sums(arms: Floats, true: Floats) -> Floats:
    """Sums of squared errors, squared bends and turns, then the number of each."""
    lines = np.moveaxis(arms, 1, 2).reshape(-1, arms.shape[1])
    bend = np.diff(lines, 2, axis=1) / STEP**2
    return np.array(
        [
            np.sum(np.square(arms - true)),
            np.sum(np.square(bend)),
            np.sum(turns(lines)),
            arms.size,
            bend.size,
            len(lines),
        ]
    )


def _means(total: Floats, kind: str) -> dict[str, float]:
    error, bend, turned = total[:3] / total[3:]
    found = {"bend": float(np.sqrt(bend)), "turns": float(turned)}
    return found if kind == TRUE else {"error": float(np.sqrt(error)), **found}


def turns(lines: Floats, least: float = TURN) -> Floats:
    """Number of turns by more than ``least`` of each line, shape (N, K) -> (N,)."""
    count = np.zeros(len(lines))
    direction = np.zeros(len(lines))
    low, high = lines[:, 0].copy(), lines[:, 0].copy()
    for value in lines.T[1:]:
        low, high = np.minimum(low, value), np.maximum(high, value)
        rises = (value - low > least) & (direction <= 0)
        falls = (high - value > least) & (direction >= 0)
        count += (rises & (direction < 0)) | (falls & (direction > 0))
        direction = np.where(rises, 1.0, np.where(falls, -1.0, direction))
        low, high = np.where(falls, value, low), np.where(rises, value, high)
    return count


def numbers(found: Measures, kind: str, group: str = ALL) -> dict[str, float]:
    """Measures that are compared.

    Returns:
        ``error`` [mm/rad], ``turns`` per sweep and muscle, ``bend`` [mm/rad^3], and ``roughness``,
        the ratio of bend and true bend.
    """
    of, true = found[kind][group], found[TRUE][group]
    return {**of, "roughness": of["bend"] / true["bend"]}
