"""Models of a machine at rest whose sensor has the errors that candidates describe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.forward_selection import Search, Settings, revise, search
from reality_gap.inference.gauss_newton import Fit, fit, null_fit
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.ranking import Ranked, rank
from reality_gap.inference.refinement import fit_next
from reality_gap.inference.screening import screen
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.splits import SELECT, split
from reality_gap.study.system import System
from reality_gap.types import Floats

Answer = Callable[[float], float]

STILL = """
<mujoco>
  <option timestep="0.005" gravity="0 0 0"/>
  <worldbody>
    <body><joint name="rail" type="slide"/><geom type="sphere" size="0.1"/></body>
  </worldbody>
  <sensor><jointpos name="position" joint="rail"/></sensor>
</mujoco>
"""
TIME = np.arange(0.0, 8.0, 0.01)
SHAPES = np.random.default_rng(0).standard_normal((len(TIME), 6))
"""Uncorrelated errors over time."""


def proportional(size: float) -> float:
    return size


def candidate(
    id: str,
    shape: Floats,
    where: str = "rail",
    answer: Answer = proportional,
    low: float = -100.0,
    sticky: bool = False,
    afar: tuple[float, ...] = (),
) -> Candidate:
    """Return a candidate that adds ``answer(size)`` times a shape (n,) to the readings."""

    def attach(effects: Effects, system: System, location: Location, values: Values) -> None:
        def add(record: Record) -> None:
            column = record.column("position")
            record.sensors[:, column] += answer(values["size"]) * np.interp(
                record.time, TIME, shape
            )

        effects.readings.append(add)

    cause = Cause(id, "", "", lambda s: (), lambda s, p: (), None, attach, sticky=sticky)
    size = Parameter("size", "1", 1.0, 0, low, 100.0, hints=SearchHints(far_starts=afar))
    return Candidate(cause, Location("joint", (where,)), (size,))


def formed(usual: float) -> Candidate:
    """Return a candidate that adds the first of `SHAPES`, and the second times ``form``."""

    def attach(effects: Effects, system: System, location: Location, values: Values) -> None:
        def add(record: Record) -> None:
            shape = SHAPES[:, 0] + values["form"] * SHAPES[:, 1]
            error = values["size"] * np.interp(record.time, TIME, shape)
            record.sensors[:, record.column("position")] += error

        effects.readings.append(add)

    plain = candidate("formed", SHAPES[:, 0])
    form = Parameter("form", "1", 1.0, 0, -100.0, 100.0, null=usual, hints=SearchHints(shape=True))
    cause = replace(plain.cause, attach=attach)
    return replace(plain, cause=cause, parameters=(*plain.parameters, form))


class Case:
    """A study with candidates.

    Args:
        folder: where the model is written.
        error: error of the sensor beside its noise, in units of the noise, shape (n,).
        chosen: the candidates.

    Attributes:
        null: residual of the nominal model, shape (n,).
        sensitivities: of all candidates.
        problem: the problem, without tolerances and inflation.
    """

    def __init__(self, folder: Path, error: Floats, chosen: Sequence[Candidate]) -> None:
        path = folder / "still.xml"
        path.write_text(STILL)
        value = error + np.random.default_rng(1).standard_normal(len(TIME))
        channel = Channel("position", "position", unit="m", noise=1.0)
        episode = Episode("only", np.zeros(1), np.zeros((1, 0)), (Reading(TIME, value),))
        self.replayer = Replayer(Study("still", path, (channel,), (episode,)))
        self.null = self.replayer.residual([])
        self.sensitivities = screen(self.replayer, chosen, self.null)
        self.problem = self.problem_with(np.zeros((len(TIME), 0)))

    def problem_with(self, tolerances: Floats) -> Problem:
        """Return the problem with tolerances (n, p)."""
        noise_model = independent_noise(self.replayer.measured, tolerances)
        return Problem(self.replayer, self.null, noise_model)

    def rank(self, base: Fit | None = None) -> list[Ranked]:
        return rank(self.problem, self.sensitivities, base or null_fit(self.problem))

    def next(self, base: Fit | None = None, refits: int = 8) -> tuple[Fit, ...]:
        return fit_next(self.problem, self.sensitivities, base or null_fit(self.problem), refits)

    def search(self, settings: Settings | None = None) -> Search:
        chosen = Settings() if settings is None else settings
        return revise(search(self.problem, self.sensitivities, chosen), chosen)

    def fit(self, *chosen: Candidate) -> Fit:
        """Fit candidates from the null, with finite differences."""
        return fit(self.problem, [(one, one.null_values()) for one in chosen])

    @property
    def learned(self) -> NDArray[np.bool_]:
        """Which readings are not in the report split, shape (n,)."""
        return split(self.replayer.measured) <= SELECT


def log_ratio(residual: Floats, columns: Floats) -> float:
    """Return the log evidence of weights of columns (n, p) for a residual (n,)."""
    wider = np.eye(len(residual)) + PRIOR**2 * columns @ columns.T
    power = residual @ residual - residual @ np.linalg.solve(wider, residual)
    return 0.5 * float(power - np.linalg.slogdet(wider)[1])


def ids(fitted: Fit) -> list[str]:
    return sorted(one.cause.id for one in fitted.candidates)


def size_of(fitted: Fit, id: str) -> float:
    return next(values["size"] for one, values in fitted.hypothesis if one.cause.id == id)


def crowd(count: int = 4) -> list[Candidate]:
    """Return candidates a, b, c, ..., each with its own shape."""
    return [candidate("abcdef"[i], SHAPES[:, i]) for i in range(count)]
