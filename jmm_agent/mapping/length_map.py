"""Interface of the maps from joint angles to muscle lengths that the estimator uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from jmm_agent.types import Floats


class LengthMap(Protocol):
    """Joints (n,) [rad] -> muscle lengths (m,) [m] and their Jacobian (m, n) [m/rad]."""

    def lengths_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]: ...


class SmoothedMap(Protocol):
    """A map that also offers the paper's five-point quadratic Jacobian (sec. II-B)."""

    def lengths(self, q: Floats) -> Floats: ...
    def jacobian_quadratic(self, q: Floats) -> Floats: ...


@dataclass(frozen=True)
class QuadraticJacobian:
    """Map with the quadratic Jacobian of another one instead of the analytic one.

    Attributes:
        source: the other map.
    """

    source: SmoothedMap

    def lengths_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]:
        """Muscle lengths and smoothed Jacobian.

        Args:
            q: joint angles (n,) [rad].

        Returns:
            Lengths (m,) [m] and Jacobian (m, n) [m/rad].
        """
        return self.source.lengths(q), self.source.jacobian_quadratic(q)
