"""Nominal model: the geometric model that the first map is trained on (paper, sec. II-A)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats, Ints

ZERO_TOLERANCE = 1e-6
"""Largest length at q = 0 [m]."""
CROSS_TOLERANCE = 1e-9
"""Largest change of a length with a joint that the muscle does not cross [m]."""


class NominalModelError(AgentError):
    """A nominal model that contradicts itself."""


class GroupTopology(NamedTuple):
    """One group of muscles.

    Attributes:
        name: of the group.
        joint_index: indices of the joints that its muscles cross.
        muscle_index: indices of its muscles.
    """

    name: str
    joint_index: Ints
    muscle_index: Ints


@dataclass(frozen=True, eq=False)
class NominalModel:
    """Joints, muscles and muscle lengths of a robot, by its geometric model.

    Attributes:
        joints: names of the n joints.
        lower: lower joint limits (n,) [rad].
        upper: upper joint limits (n,) [rad].
        muscles: names of the m muscles.
        crosses: whether muscle i crosses joint j (m, n).
        lengths: maps postures (B, n) [rad] to muscle lengths (B, m) [m] relative to q = 0.
        groups: the joints that each group owns, groups in proximal-to-distal order; every joint
            is owned by one group.
        points: maps postures (B, n) [rad] to how the lengths change if points of attachment are
            displaced (B, m, P) [1], P numbers for each muscle, 0 where it has fewer; None: unknown.

    Raises:
        NominalModelError: names or shapes do not match, or `lengths` contradicts `crosses`.
    """

    joints: tuple[str, ...]
    lower: Floats
    upper: Floats
    muscles: tuple[str, ...]
    crosses: NDArray[np.bool_]
    lengths: Callable[[Floats], Floats]
    groups: dict[str, tuple[str, ...]]
    points: Callable[[Floats], Floats] | None = None

    def __post_init__(self) -> None:
        for field in ("joints", "muscles"):
            names = tuple(getattr(self, field))
            object.__setattr__(self, field, names)
            _check_names(field, names)
        n, m = len(self.joints), len(self.muscles)
        for field, kind, shape in (
            ("lower", np.float64, (n,)),
            ("upper", np.float64, (n,)),
            ("crosses", np.bool_, (m, n)),
        ):
            array = np.array(getattr(self, field), dtype=kind)
            if array.shape != shape:
                raise NominalModelError(
                    f"Nominal model: {field} has shape {array.shape}, but {shape} fits."
                )
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        groups = {name: tuple(owned) for name, owned in self.groups.items()}
        object.__setattr__(self, "groups", groups)
        self._check_limits()
        self._check_groups()
        self._check_lengths()
        self._check_points()

    def topology(self) -> tuple[GroupTopology, ...]:
        """Groups with all joints that their muscles cross (sec. II-A), proximal to distal.

        A muscle belongs to the most distal group of which it crosses an owned joint. The joints of
        a group are all joints that its muscles cross; those of the shoulder include the scapula's.
        """
        owner = {joint: rank for rank, owned in enumerate(self.groups.values()) for joint in owned}
        rank_of_joint = np.array([owner[joint] for joint in self.joints])
        rank_of_muscle = np.where(self.crosses, rank_of_joint, -1).max(axis=1)
        result = []
        for rank, name in enumerate(self.groups):
            muscles = np.flatnonzero(rank_of_muscle == rank)
            joints = np.flatnonzero(self.crosses[muscles].any(axis=0))
            result.append(GroupTopology(name, joints, muscles))
        return tuple(result)

    def _check_limits(self) -> None:
        good = np.isfinite(self.lower) & np.isfinite(self.upper) & (self.lower < self.upper)
        if not good.all():
            j = int(np.flatnonzero(~good)[0])
            raise NominalModelError(
                f"Nominal model: joint {self.joints[j]!r} has limits [{self.lower[j]}, "
                f"{self.upper[j]}], but they must be finite, lower below upper."
            )

    def _check_groups(self) -> None:
        owned = [joint for joints in self.groups.values() for joint in joints]
        for joint in owned:
            if joint not in self.joints:
                raise NominalModelError(
                    f"Nominal model: a group owns the unknown joint {joint!r}; joints are "
                    f"{list(self.joints)}."
                )
        for joint in self.joints:
            if owned.count(joint) != 1:
                raise NominalModelError(
                    f"Nominal model: joint {joint!r} is owned by {owned.count(joint)} groups, but "
                    "each joint must be owned by exactly one."
                )
        for name, crossed in zip(self.muscles, self.crosses.sum(axis=1), strict=True):
            if crossed == 0:
                raise NominalModelError(f"Nominal model: muscle {name!r} crosses no joint.")
        for name, crossed in zip(self.joints, self.crosses.sum(axis=0), strict=True):
            if crossed == 0:
                raise NominalModelError(f"Nominal model: joint {name!r} is crossed by no muscle.")
        for group in self.topology():
            if group.muscle_index.size == 0:
                raise NominalModelError(
                    f"Nominal model: group {group.name!r} has no muscle; merge it with its "
                    "neighbour."
                )

    def _check_lengths(self) -> None:
        n, m = len(self.joints), len(self.muscles)
        base = self.lower + 0.4 * (self.upper - self.lower)
        moved = base + 0.2 * np.diag(self.upper - self.lower)
        postures = np.vstack([np.zeros(n), base, moved])
        lengths = np.asarray(self.lengths(postures))
        if lengths.shape != (n + 2, m):
            raise NominalModelError(
                f"Nominal model: lengths of {n + 2} postures have shape {lengths.shape}, but "
                f"{(n + 2, m)} is needed."
            )
        if not np.isfinite(lengths).all():
            raise NominalModelError(
                "Nominal model: lengths are not finite inside the joint limits."
            )
        worst = int(np.abs(lengths[0]).argmax())
        if abs(lengths[0, worst]) > ZERO_TOLERANCE:
            raise NominalModelError(
                f"Nominal model: muscle {self.muscles[worst]!r} has length {lengths[0, worst]} m "
                "at q = 0, but lengths must be relative to q = 0."
            )
        change = np.abs(lengths[2:] - lengths[1]).T
        wrong = np.argwhere((change > CROSS_TOLERANCE) & ~self.crosses)
        if wrong.size:
            i, j = wrong[0]
            raise NominalModelError(
                f"Nominal model: muscle {self.muscles[i]!r} changes with joint {self.joints[j]!r}, "
                "but `crosses` is False for them."
            )

    def _check_points(self) -> None:
        if self.points is None:
            return
        found = np.asarray(self.points(self.lower[None]))
        if found.ndim != 3 or found.shape[:2] != (1, len(self.muscles)):
            raise NominalModelError(
                f"Nominal model: points of one posture have shape {found.shape}, but "
                f"(1, {len(self.muscles)}, P) is needed."
            )
        if not np.isfinite(found).all():
            raise NominalModelError("Nominal model: points are not finite at the lower limits.")


def _check_names(field: str, names: tuple[str, ...]) -> None:
    if not names or len(set(names)) != len(names):
        raise NominalModelError(
            f"Nominal model: {field} must be at least one and all different: {names}."
        )
