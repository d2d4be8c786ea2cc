"""Changes of thermal parameters: generalised likelihood ratios from several starts.

Every few minutes a copy of the filter begins at the present estimate, with parameters that may be
wrong as far as they are uncertain, but that do not change any more. If a parameter did change then,
the innovations of the copy show it: a change by delta of entry j of the state makes them

    nu_t = white noise + g_jt delta,   g_jt = H e_jt,   e_j,t+1 = F (I - K H) e_jt,   e_j0 = unit j

so that the likeliest delta and twice its log-likelihood ratio are

    delta = c_j / G_jj,   c_j^2 / G_jj,     c_j = sum g_jt nu_t / S_t,   G_ij = sum g_it g_jt / S_t

(Willsky and Jones 1976). Warmer surroundings do the same to all motors: the change of the ambient
temperature that the median motor shows is taken out before.

Several parameters may explain a change about as well at first. It is then in doubt, which widens
the intervals, and is named when one parameter remains, or after a while with all that remain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.heat.model import AMBIENT, FIRST, HOUSING, SIZE
from jmm_agent.heat.parameters import NAMES, HeatOptions
from jmm_agent.heat.thermal_filter import ThermalFilter
from jmm_agent.types import Floats

COPIES = 5
"""Number of copies; the oldest is replaced."""
APART = 0.17
"""Time between their beginnings, as a share of the nominal housing time constant [1]."""
ENOUGH = 4
"""Number of motors from which on their median shows what the surroundings do."""
PRECISE = 0.08
"""Largest standard deviation of the logarithm of a change that is named [1]."""
CLOSE = 25.0
"""Twice the log-likelihood ratio below which two parameters are not told apart."""
PLAUSIBLE = 0.4
"""Least change of a parameter that is named beside another, as a share of one that is a fault."""
ALIKE = 0.9
"""Correlation of the readings that two parameters' changes cause, above which they are not told
apart: the likelihood then shows the filter's own errors [1]."""
DECIDED = 0.3
"""Time after which a change is named in any case, as a share of the housing time constant [1]."""
ENTRIES = SIZE - AMBIENT
"""Number of entries of the state whose changes are compared: the ambient's and the parameters'."""


class Change(NamedTuple):
    """A parameter of a motor that changed, or may have.

    Attributes:
        motor: its index.
        parameter: index in `NAMES` ...
        others: ... and of those that explain the readings about as well.
        factor: new value over the one before [1].
        before: values of all parameters before (5,) ...
        covariance: ... and covariance of their logarithms (5, 5).
        surroundings: whether warmer or colder surroundings of this motor alone explain as much.
        decided: whether it is to be named.
        new: whether it was not in doubt before.
    """

    motor: int
    parameter: int
    others: tuple[int, ...]
    factor: float
    before: Floats
    covariance: Floats
    surroundings: bool
    decided: bool = False
    new: bool = True


class ChangeDetector:
    """Watches the parameters of m motors.

    Args:
        count: number of motors, m.
        options: thresholds.
    """

    def __init__(self, count: int, options: HeatOptions) -> None:
        self._options, self._count = options, count
        self._copies = ThermalFilter((COPIES, count), options)
        self._apart = APART * options.nominal.housing_time
        self._patience = DECIDED * options.nominal.housing_time
        self.reset()

    def reset(self) -> None:
        """Forget all copies, as after a pause of unknown length."""
        shape = (COPIES, self._count)
        self._begun = np.zeros(shape, dtype=bool)
        self._waited: dict[int, float] = {}
        self._since, self._next = np.inf, 0
        self._signatures = np.zeros((*shape, SIZE, ENTRIES))
        self._gram = np.zeros((*shape, ENTRIES, ENTRIES))
        self._found = np.zeros((*shape, ENTRIES))
        self._before = np.zeros((*shape, len(NAMES)))
        self._covariance = np.zeros((*shape, len(NAMES), len(NAMES)))

    def update(
        self, main: ThermalFilter, heat: Floats, time: float, reading: Floats, noise: Floats
    ) -> list[Change]:
        """Add a step of the filter of all motors; changes that are new, in doubt or decided.

        Args:
            main: the filter, after that step.
            heat: mean square of the tensions (m,) [N^2].
            time: of the step [s].
            reading: that it used (m,) [degC]; NaN for none.
            noise: variance of the readings (m,) [K^2].
        """
        shape = (COPIES, self._count)
        flow = self._copies.predict(np.broadcast_to(heat, shape), time, walk=0.0)
        step = self._copies.correct(np.broadcast_to(reading, shape), np.broadcast_to(noise, shape))
        expected = flow @ self._signatures
        shown = expected[..., HOUSING, :]
        known = np.isfinite(step.innovation)
        weight = np.where(known, 1.0 / step.variance, 0.0)
        innovation = np.where(known, step.innovation, 0.0)
        self._gram += weight[..., None, None] * shown[..., :, None] * shown[..., None, :]
        self._found += (weight * innovation)[..., None] * shown
        self._signatures = expected - step.gain[..., :, None] * shown[..., None, :]
        changes = list(self._decide(self._changes(), time))
        self._since += time
        if self._since >= self._apart:
            self._begin(main)
        return changes

    def _begin(self, main: ThermalFilter) -> None:
        """Let the oldest copy begin at the present estimate."""
        row, self._next, self._since = self._next, (self._next + 1) % COPIES, 0.0
        self._copies.x[row], self._copies.p[row] = main.x, main.p
        self._signatures[row] = np.eye(SIZE)[:, AMBIENT:]
        self._gram[row], self._found[row] = 0.0, 0.0
        self._before[row] = np.exp(main.x[..., FIRST:])
        self._covariance[row] = main.p[..., FIRST:, FIRST:]
        self._begun[row] = True

    def _changes(self) -> list[Change]:
        """The changes that any copy shows, one for each motor."""
        found = self._found - self._common()[..., None] * self._gram[..., :, 0]
        information = np.maximum(np.diagonal(self._gram, axis1=-2, axis2=-1), 1e-12)
        size = (found / information)[..., 1:]
        gained = found**2 / information
        around, gained = gained[..., 0], gained[..., 1:]
        precise = information[..., 1:] > PRECISE**-2
        large = np.abs(np.expm1(np.clip(size, -2.0, 2.0))) >= self._options.changed
        most = gained.max(axis=-1)
        candidate = (gained >= most[..., None] - CLOSE) & precise & large
        relative = np.abs(np.expm1(np.clip(size, -2.0, 2.0)))
        plausible = (gained >= most[..., None] - CLOSE) & precise
        plausible &= relative >= PLAUSIBLE * self._options.changed
        candidate &= (self._begun & (most >= self._options.evidence))[..., None]
        changes = []
        for motor in np.flatnonzero(candidate.any(axis=(0, 2))):
            score = np.where(candidate[:, motor], gained[:, motor], -np.inf)
            row, first = divmod(int(score.argmax()), len(NAMES))
            gram = self._gram[row, motor, 1:, 1:]
            alike = np.abs(gram[first]) > ALIKE * np.sqrt(np.diag(gram) * gram[first, first])
            close = np.flatnonzero(plausible[row, motor] | alike)
            others = tuple(int(other) for other in close if other != first)
            factor = float(np.exp(size[row, motor, first]))
            before = self._before[row, motor].copy()
            local = bool(around[row, motor] >= most[row, motor] - CLOSE)
            known = self._covariance[row, motor].copy()
            changes.append(Change(int(motor), first, others, factor, before, known, local))
        return changes

    def _decide(self, changes: Sequence[Change], time: float) -> Iterator[Change]:
        """Changes that are new, and those that are to be named."""
        waited = {motor: since - time for motor, since in self._waited.items() if since > time}
        doubted = self._waited.keys()
        for change in changes:
            waited[change.motor] = self._waited.get(change.motor, 0.0) + time
        for change in changes:
            decided = not change.others or waited[change.motor] >= self._patience
            if decided:
                self._begun[:, change.motor] = False
                del waited[change.motor]
            new = change.motor not in doubted
            if decided or new:
                yield change._replace(decided=decided, new=new)
        self._waited = waited

    def _common(self) -> Floats:
        """Change of the ambient temperature that the median motor shows, by copy (k, 1) [K]."""
        if self._count < ENOUGH:
            return np.zeros((COPIES, 1))
        information = self._gram[..., 0, 0]
        size = self._found[..., 0] / np.maximum(information, 1e-12)
        size = np.where(information > 1e-6, size, np.nan)
        known = np.isfinite(size).sum(axis=1) >= ENOUGH
        filled = np.where(known[:, None], size, 0.0)
        return np.asarray(np.nanmedian(filled, axis=1)[:, None])
