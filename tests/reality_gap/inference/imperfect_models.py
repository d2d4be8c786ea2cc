"""A machine that stands still, whose sensor errs as causes say, and its suspects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.forward_selection import Search, Settings, revise, search
from reality_gap.inference.gauss_newton import Fit, fit
from reality_gap.inference.likelihood import noise_model
from reality_gap.inference.refinement import try_next
from reality_gap.inference.screening import screen
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.splits import CHOOSE, split
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
"""Errors over time that have nothing to do with each other."""


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
    """A cause that adds ``answer(size)`` times a shape (n,) to what the sensor reads."""

    def attach(effects: Effects, system: System, location: Location, values: Values) -> None:
        def sense(record: Record) -> None:
            column = record.column("position")
            record.sensors[:, column] += answer(values["size"]) * np.interp(
                record.time, TIME, shape
            )

        effects.readings.append(sense)

    cause = Cause(id, "", "", lambda s: (), lambda s, p: (), None, attach, sticky=sticky)
    size = Parameter("size", "1", 1.0, 0, low, 100.0, hints=SearchHints(far_starts=afar))
    return Candidate(cause, Location("joint", (where,)), (size,))


def formed(usual: float) -> Candidate:
    """A cause of the first of `SHAPES` and ``form``, as a rule ``usual``, times the second."""

    def attach(effects: Effects, system: System, location: Location, values: Values) -> None:
        def sense(record: Record) -> None:
            shape = SHAPES[:, 0] + values["form"] * SHAPES[:, 1]
            error = values["size"] * np.interp(record.time, TIME, shape)
            record.sensors[:, record.column("position")] += error

        effects.readings.append(sense)

    plain = candidate("formed", SHAPES[:, 0])
    form = Parameter("form", "1", 1.0, 0, -100.0, 100.0, null=usual, hints=SearchHints(shape=True))
    cause = replace(plain.cause, attach=attach)
    return replace(plain, cause=cause, parameters=(*plain.parameters, form))


class Case:
    """A study, whom it suspects, and what a search is given.

    Args:
        folder: for the model.
        error: (n,) what the sensor errs by, in units of its noise, beside the noise.
        chosen: whom to suspect.
    """

    def __init__(self, folder: Path, error: Floats, chosen: Sequence[Candidate]) -> None:
        path = folder / "still.xml"
        path.write_text(STILL)
        value = error + np.random.default_rng(1).standard_normal(len(TIME))
        channel = Channel("position", "position", unit="m", noise=1.0)
        episode = Episode("only", np.zeros(1), np.zeros((1, 0)), (Reading(TIME, value),))
        self.replayer = Replayer(Study("still", path, (channel,), (episode,)))
        self.null = self.replayer.residual([])
        self.tolerances = np.zeros((len(TIME), 0))
        self.found = screen(self.replayer, chosen, [], self.null)
        self.rule = noise_model(self.replayer.measured, self.null, self.tolerances)

    def next(self, base: Fit | None = None, refits: int = 8) -> tuple[Fit, ...]:
        return try_next(self.replayer, self.found, self.rule, base, refits)

    def search(self, settings: Settings | None = None) -> Search:
        chosen = Settings() if settings is None else settings
        found = search(self.replayer, self.found, self.null, self.tolerances, chosen)
        return revise(self.replayer, found, chosen)

    def fit(self, *chosen: Candidate) -> Fit:
        """From the null, with differences."""
        start = [(one, one.nulls()) for one in chosen]
        return fit(self.replayer, start, self.rule.learn, self.null)

    @property
    def learned(self) -> NDArray[np.bool_]:
        """(n,) which readings are not kept for the report."""
        return split(self.replayer.measured) <= CHOOSE


def log_ratio(residual: Floats, columns: Floats) -> float:
    """How much likelier a residual (n,) is with weights of the columns (n, p) than without."""
    wider = np.eye(len(residual)) + PRIOR**2 * columns @ columns.T
    power = residual @ residual - residual @ np.linalg.solve(wider, residual)
    return 0.5 * float(power - np.linalg.slogdet(wider)[1])


def ids(fitted: Fit | None) -> list[str]:
    return sorted(one.cause.id for one in fitted.candidates) if fitted else []


def size_of(fitted: Fit, id: str) -> float:
    return next(values["size"] for one, values in fitted.hypothesis if one.cause.id == id)


def crowd(count: int = 4) -> list[Candidate]:
    """Suspects a, b, c, ... each with a shape of its own."""
    return [candidate("abcdef"[i], SHAPES[:, i]) for i in range(count)]
