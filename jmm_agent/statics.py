"""Interface of the statics of a nominal model: whether the muscles can hold a posture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from jmm_agent.types import Floats


class Hold(Protocol):
    """Whether the muscles can hold a posture.

    Attributes:
        reachable: whether they can, stably and with lengths that are slightly wrong, too.
        tension: smallest maximum of tensions that hold the posture [N]; infinite if none do.
        reason: why not, without a full stop; empty if the posture is reachable.
    """

    @property
    def reachable(self) -> bool: ...

    @property
    def tension(self) -> float: ...

    @property
    def reason(self) -> str: ...


class Statics(Protocol):
    """Statics of a nominal model, such as `kengoro_env.Statics`."""

    def hold(self, posture: Floats) -> Hold:
        """Whether the muscles can hold a posture.

        Args:
            posture: joint angles (n,) [rad].
        """


def holds_of(statics: Statics | None, postures: Floats) -> list[Hold]:
    """Whether the muscles can hold postures; nothing if that is unknown.

    Args:
        statics: of the nominal model; None if there is none.
        postures: joint angles (K, n), or (n,) of one [rad].
    """
    return [] if statics is None else [statics.hold(posture) for posture in np.atleast_2d(postures)]


def not_reachable(holds: Sequence[Hold]) -> str:
    """One sentence on the postures of a list that cannot be held; empty if all can.

    Args:
        holds: of each posture.
    """
    missed = [(number, hold) for number, hold in enumerate(holds) if not hold.reachable]
    if not missed:
        return ""
    number, first = missed[0]
    which = "The posture" if len(holds) == 1 else f"Posture {number} of {len(holds)}"
    more = f" (and {len(missed) - 1} more)" if len(missed) > 1 else ""
    return f"{which} is not reachable{more}: {first.reason}."
