"""Bounds of the environments' spaces, and the affine map between actions and lengths.

An entry of an action in [-1, 1] commands the target length of a muscle

    length = low + (action + 1) / 2 * (high - low),

where low and high are the smallest and the largest length of the muscle in the nominal model over
the box of joint ranges, minus and plus `MARGIN`, because a real robot is zeroed in another posture.
Actions are float32, as learning libraries send them: one step of it is at most 0.04 micrometres.
Entries that rounding takes beyond 1, up to `LARGEST`, count as 1.

The bounds are an asset, because computing them takes long. After a change of the arm's model
``python -m kengoro_env.spaces`` recomputes them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from kengoro_env.arguments import described, real_numbers
from kengoro_env.assets import asset_path, assets_root
from kengoro_env.errors import ArgumentError, InvalidActionError
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.types import Floats
from mjcf_sandbox.files import write_json

MARGIN = 0.06
"""Length beyond the range of the nominal model that a space allows [m]."""

TENSION_RANGE = 1000.0
"""Largest reading of a tension sensor [N]: twice the largest tension of a motor."""

LARGEST = 1.0 + 1e-6
"""Largest entry of an action, beyond 1 by rounding to float32; it commands what 1 does."""

LATEST = 86_400.0
"""Largest time of a frame [s]."""

SAMPLES = 2000
"""Number of postures from which bounds are computed."""

BOUNDS = "bounds.json"
"""Asset with the smallest and the largest length [m] of each muscle in each of `SCENES`."""

SCENES = tuple(f"mjcf/kengoro_arm/{name}.xml" for name in ("can_grasp", "posture", "elbow"))
"""Scenes of the tasks."""


@dataclass(frozen=True)
class LengthBounds:
    """Bounds of the muscles' lengths, and the map between lengths and actions.

    Attributes:
        low: smallest lengths (m,) [m].
        high: largest lengths (m,) [m].
    """

    low: Floats
    high: Floats

    @cached_property
    def _middle(self) -> Floats:
        """Lengths that an action of 0 commands (m,) [m]."""
        return (self.low + self.high) / 2.0

    @cached_property
    def _half(self) -> Floats:
        """Change of the lengths from an action of 0 to one of 1 (m,) [m]."""
        return (self.high - self.low) / 2.0

    @cached_property
    def most_tension(self) -> Floats:
        """Largest readings of the tension sensors (m,) [N]."""
        most = np.full(self.low.shape, TENSION_RANGE)
        most.setflags(write=False)
        return most

    def layout(self) -> dict[str, Floats]:
        """Values of the fields of ``Step`` in control_step.c, arrays (m,)."""
        return {
            "half": self._half,
            "middle": self._middle,
            "low": self.low,
            "high": self.high,
            "most_tension": self.most_tension,
        }

    def to_action(self, lengths: Floats) -> NDArray[np.float32]:
        """Action that commands lengths (m,) [m]; lengths out of bounds are clipped."""
        share = (lengths - self.low) / (self.high - self.low)
        return np.clip(2.0 * share - 1.0, -1.0, 1.0).astype(np.float32)

    def to_lengths(self, action: Floats) -> Floats:
        """Lengths (m,) [m] that an action (m,), in float64, commands, up to rounding."""
        lengths: Floats = action * self._half
        lengths += self._middle
        return lengths


@cache
def length_bounds(scene: str) -> LengthBounds:
    """Bounds for a scene of `SCENES`, in the order of its muscles."""
    shipped = json.loads(asset_path(BOUNDS).read_text(encoding="utf-8"))[scene]
    low, high = np.array(list(shipped.values())).T.copy()
    return _fixed(low, high)


def computed_bounds(nominal: NominalArm) -> LengthBounds:
    """Bounds for an arm, from postures in and at the corners of the box of joint ranges."""
    rng = np.random.default_rng(0)
    share = rng.uniform(size=(SAMPLES, len(nominal.joints)))
    share[::2] = np.round(share[::2])
    lengths = nominal.lengths(nominal.lower + share * (nominal.upper - nominal.lower))
    return _fixed(lengths.min(axis=0) - MARGIN, lengths.max(axis=0) + MARGIN)


def _fixed(low: Floats, high: Floats) -> LengthBounds:
    for bound in (low, high):
        bound.setflags(write=False)
    return LengthBounds(low, high)


def box(low: object, high: object, shape: tuple[int, ...]) -> spaces.Box:
    """A box of float64 between two bounds that broadcast to ``shape``."""
    low, high = (np.broadcast_to(np.asarray(bound, dtype=float), shape) for bound in (low, high))
    return spaces.Box(low.copy(), high.copy(), dtype=np.float64)


def checked_dtype(dtype: object) -> np.dtype[Any]:
    """The dtype of the numbers in observations.

    Args:
        dtype: `numpy.float64` or `numpy.float32`, as a type, a dtype or a name.

    Raises:
        ArgumentError: it is neither.
    """
    try:
        found = None if dtype is None else np.dtype(dtype)  # type: ignore[call-overload]
    except TypeError:
        found = None
    if found is None or found not in (np.dtype(np.float64), np.dtype(np.float32)):
        raise ArgumentError(f"dtype must be numpy.float64 or numpy.float32, got {dtype!r}")
    return found


def in_dtype(space: spaces.Dict, dtype: np.dtype[Any]) -> spaces.Dict:
    """A space with boxes of ``dtype`` in place of those of float64."""
    return spaces.Dict({name: _box_in(entry, dtype) for name, entry in space.spaces.items()})


def _box_in(entry: spaces.Space[Any], dtype: np.dtype[Any]) -> spaces.Space[Any]:
    if not isinstance(entry, spaces.Box) or entry.dtype != np.float64:
        return entry
    return spaces.Box(entry.low.astype(dtype), entry.high.astype(dtype), dtype=dtype.type)


@cache
def _largest(count: int) -> Floats:
    return np.full(count, LARGEST)


def checked_action(action: object, entries: Sequence[str]) -> Floats:
    """The action as an array (k,) of float64 within [-1, 1].

    Args:
        action: the action.
        entries: names of its k entries.

    Raises:
        InvalidActionError: wrong shape, or an entry that is not a number in [-1, 1].
    """
    array = real_numbers(action)
    if array is None:
        raise InvalidActionError(
            f"an action must be {len(entries)} real numbers within [-1, 1], got {described(action)}"
        )
    if array.shape != (len(entries),):
        raise InvalidActionError(
            f"an action must have the shape ({len(entries)},), one entry a muscle"
            f"{' and one for the fingers' if entries[-1] == 'fingers' else ''}, got {array.shape}"
        )
    check_actions(array, entries)
    return np.clip(array, -1.0, 1.0)


def check_actions(actions: NDArray[np.floating[Any]], entries: Sequence[str]) -> None:
    """Check the values of an action (k,), or of the actions of many environments (count, k).

    Raises:
        InvalidActionError: an entry is not a finite number in [-1, 1].
    """
    within = np.abs(actions) <= _largest(actions.shape[-1])
    if b"\0" not in within.tobytes():  # a quarter of the time of within.all()
        return
    *row, first = np.argwhere(~within)[0]
    environment = f"environment {row[0]}: " if row else ""
    value = np.format_float_positional(actions[(*row, first)], trim="-")
    raise InvalidActionError(
        f"{environment}entry {first} of the action ({entries[first]}) is {value}: every entry must "
        "be a finite number within [-1, 1]"
    )


def main() -> None:
    """Recompute the bounds of all scenes and write them to the asset."""
    found = {}
    for scene in SCENES:
        nominal = NominalArm(asset_path(scene))
        bounds = computed_bounds(nominal)
        pairs = np.column_stack([bounds.low, bounds.high]).tolist()
        found[scene] = dict(zip(nominal.muscles, pairs, strict=True))
    write_json(assets_root() / BOUNDS, found)


if __name__ == "__main__":
    main()
