"""Stretch of the tendons by their tension, as a part of the joint-muscle mapping.

An encoder measures the length that was paid out, which is the path minus what the tendon stretches.
A tendon is a hardening spring, T = x / compliance + hardening x^2 for a stretch x > 0. The networks
of a map hold the lengths at a tension of reference, so that

    l(theta, T) = f(theta) - x(T) + x(reference).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats

FIELDS = ("compliance", "hardening", "reference")
"""Names of the arrays of a `TendonStretch`."""


@dataclass(frozen=True, eq=False)
class TendonStretch:
    """Tendons of m muscles.

    Attributes:
        compliance: stretch per tension at small tensions (m,) [m/N]; 0: none.
        hardening: coefficient of the quadratic term of the tension (m,) [N/m^2].
        reference: tension at which the networks of the map hold (m,) [N], such as T_bias.

    Raises:
        AgentError: an array is negative, not finite or not of the shape of the others.
    """

    compliance: Floats
    hardening: Floats
    reference: Floats

    def __post_init__(self) -> None:
        shape = np.shape(self.compliance)
        for field in fields(self):
            array = np.array(getattr(self, field.name), dtype=float)
            if array.ndim != 1 or array.shape != shape or not np.all((array >= 0) & (array < 1e30)):
                raise AgentError(
                    f"TendonStretch: {field.name} must be finite numbers from 0 on, one for each "
                    f"muscle, got {getattr(self, field.name)!r}."
                )
            array.setflags(write=False)
            object.__setattr__(self, field.name, array)

    def of(self, muscles: Sequence[int]) -> TendonStretch:
        """Tendons of some muscles.

        Args:
            muscles: their indices.
        """
        index = list(muscles)
        return TendonStretch(*(getattr(self, field.name)[index] for field in fields(self)))

    def stretch(self, tensions: Floats) -> Floats:
        """Stretch beyond that at the reference (..., m) [m].

        Args:
            tensions: (..., m) [N]; one below 0 counts as 0.
        """
        return np.asarray(self._total(tensions) - self._total(self.reference))

    def slope(self, tensions: Floats) -> Floats:
        """Compliance at a tension, dx/dT (..., m) [m/N].

        Args:
            tensions: (..., m) [N]; one below 0 counts as 0.
        """
        return np.asarray(self.compliance / self._root(tensions))

    def _total(self, tensions: Floats) -> Floats:
        pull = np.maximum(tensions, 0.0)
        return np.asarray(2.0 * self.compliance * pull / (1.0 + self._root(pull)))

    def _root(self, tensions: Floats) -> Floats:
        pull = np.maximum(tensions, 0.0)
        return np.asarray(np.sqrt(1.0 + 4.0 * self.hardening * self.compliance**2 * pull))
