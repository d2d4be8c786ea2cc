"""What the estimator asks of a map from joint angles to muscle lengths."""

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
    """Gives the estimator the quadratic Jacobian of `source` instead of the analytic one."""

    source: SmoothedMap

    def lengths_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]:
        """Lengths (m,) [m] and smoothed Jacobian (m, n) [m/rad]."""
        return self.source.lengths(q), self.source.jacobian_quadratic(q)
