"""Bounded spaces of the environments, and the affine map between actions and lengths.

An entry of an action in [-1, 1] maps to a wire's target length by

    length = low + (action + 1) / 2 * (high - low)

where low and high are the least and the largest length that the drawing's wire takes over the box
of joint ranges, and `MARGIN` more: a real robot's lengths were zeroed elsewhere. Actions are
float32, as learning libraries send them: one step of it is at most 0.04 micrometres of wire.

Bounds are an asset, so that no start waits for them; after a change of the arm's model
``python -m kengoro_env.spaces`` writes them anew.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from kengoro_env.assets import asset_path, assets_root
from kengoro_env.errors import KengoroError
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.types import Floats
from mjcf_sandbox.files import write_json

MARGIN = 0.06
"""How far beyond the drawing's range a length may be [m]."""

TENSION_RANGE = 1000.0
"""What a tension sensor reads at most [N]: twice what a motor pulls with."""

LATEST = 86_400.0
"""What a frame's clock shows at most [s]."""

SAMPLES = 2000

BOUNDS = "bounds.json"
"""The asset with least and largest length [m] of each wire of each of `SCENES`."""

SCENES = tuple(f"mjcf/kengoro_arm/{name}.xml" for name in ("can_grasp", "posture", "elbow"))
"""Those that a task has."""


class InvalidActionError(KengoroError):
    """An action of the wrong shape, not finite, or out of [-1, 1]."""


@dataclass(frozen=True)
class LengthBounds:
    """Bounds of the wires' lengths (m,) [m], and the map from and to actions (m,) in [-1, 1]."""

    low: Floats
    high: Floats

    @cached_property
    def _middle(self) -> Floats:
        """Half way from low to high (m,) [m]: what an action of 0 commands."""
        return (self.low + self.high) / 2.0

    @cached_property
    def _half(self) -> Floats:
        """Half the way from low to high (m,) [m]: what an action of 1 moves a target by."""
        return (self.high - self.low) / 2.0

    @cached_property
    def most_tension(self) -> Floats:
        """What the tension sensors read at most (m,) [N]."""
        most = np.full(self.low.shape, TENSION_RANGE)
        most.setflags(write=False)
        return most

    def layout(self) -> dict[str, Floats]:
        """Arrays (m,) by their names in control_step.c."""
        return {
            "half": self._half,
            "middle": self._middle,
            "low": self.low,
            "high": self.high,
            "most_tension": self.most_tension,
        }

    def to_action(self, lengths: Floats) -> NDArray[np.float32]:
        """The action that commands ``lengths`` (m,) [m]; lengths out of bounds are cut."""
        share = (lengths - self.low) / (self.high - self.low)
        return np.clip(2.0 * share - 1.0, -1.0, 1.0).astype(np.float32)

    def to_lengths(self, action: Floats) -> Floats:
        """The lengths (m,) [m] that an action (m,), in float64, commands, to rounding."""
        lengths: Floats = action * self._half
        lengths += self._middle
        return lengths


@cache
def length_bounds(scene: str) -> LengthBounds:
    """Bounds of the lengths of the wires of ``scene``, one of `SCENES`, in its order of them."""
    shipped = json.loads(asset_path(BOUNDS).read_text(encoding="utf-8"))[scene]
    low, high = np.array(list(shipped.values())).T.copy()
    return _fixed(low, high)


def computed_bounds(drawing: NominalArm) -> LengthBounds:
    """Bounds for an arm, from postures all over and at the corners of the box of joint ranges."""
    rng = np.random.default_rng(0)
    share = rng.uniform(size=(SAMPLES, len(drawing.joints)))
    share[::2] = np.round(share[::2])
    lengths = drawing.lengths(drawing.lower + share * (drawing.upper - drawing.lower))
    return _fixed(lengths.min(axis=0) - MARGIN, lengths.max(axis=0) + MARGIN)


def _fixed(low: Floats, high: Floats) -> LengthBounds:
    for bound in (low, high):
        bound.setflags(write=False)
    return LengthBounds(low, high)


def box(low: object, high: object, shape: tuple[int, ...]) -> spaces.Box:
    """A float64 box."""
    low, high = (np.broadcast_to(np.asarray(bound, dtype=float), shape) for bound in (low, high))
    return spaces.Box(low.copy(), high.copy(), dtype=np.float64)


@cache
def _ones(count: int) -> Floats:
    return np.ones(count)


def checked_action(action: object, entries: Sequence[str]) -> Floats:
    """The action as an array, float64, with an entry for each of ``entries``.

    Raises:
        InvalidActionError: wrong shape, or an entry that is not a number in [-1, 1].
    """
    try:
        array = np.asarray(action, float)
    except (TypeError, ValueError):
        raise InvalidActionError(
            f"an action must be {len(entries)} numbers within [-1, 1], got {action!r}"
        ) from None
    if array.shape != (len(entries),):
        raise InvalidActionError(
            f"an action must have the shape ({len(entries)},), one entry a muscle"
            f"{' and one for the fingers' if entries[-1] == 'fingers' else ''}, got {array.shape}"
        )
    within = np.abs(array) <= _ones(array.size)
    if b"\0" in within.tobytes():  # some are not, in a quarter of the time that NumPy takes
        first = np.flatnonzero(~within)[0]
        raise InvalidActionError(
            f"entry {first} of the action ({entries[first]}) is {array[first]:g}: every entry must "
            "be a finite number within [-1, 1]"
        )
    return array


def main() -> None:
    """Compute the bounds of all scenes anew and write them."""
    found = {}
    for scene in SCENES:
        drawing = NominalArm(asset_path(scene))
        bounds = computed_bounds(drawing)
        pairs = np.column_stack([bounds.low, bounds.high]).tolist()
        found[scene] = dict(zip(drawing.muscles, pairs, strict=True))
    write_json(assets_root() / BOUNDS, found)


if __name__ == "__main__":
    main()
