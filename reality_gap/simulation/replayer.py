"""Where hypotheses are tried: replays of a study with suspects in it, several at once."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cached_property
from types import TracebackType

import numpy as np

from mjcf_sandbox.parent_watchdog import end_with_parent
from reality_gap.causes import CATALOGUE, register
from reality_gap.causes.base import Cause, Location, Values
from reality_gap.errors import StudyError
from reality_gap.simulation.episode import silence
from reality_gap.simulation.hypothesis import Candidate, Plant, build
from reality_gap.simulation.inverse_dynamics import inverse_replay, ready
from reality_gap.simulation.replay import Memory, Replay, replay
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, measured
from reality_gap.study.system import System, look_at
from reality_gap.types import Floats

Part = tuple[Candidate, Values]
Hypothesis = Sequence[Part]
Tick = Callable[[], None]

USUAL = "usual"
"""Tells the place of what is usual from that of a suspect."""


class Replayer:
    """Replays hypotheses of one study.

    Args:
        study: what was measured.
        jobs: number of processes.
        tick: called after every replay.
    """

    def __init__(self, study: Study, jobs: int = 1, tick: Tick = lambda: None) -> None:
        study = ready(study)
        self.system: System = look_at(study)
        self.measured: Measured = measured(study)
        self.tick = tick
        self._memory = Memory()
        self._coarse: bool | None = None
        self._pool = (
            ProcessPoolExecutor(
                jobs,
                multiprocessing.get_context("forkserver"),
                _open,
                initargs=(study, tuple(CATALOGUE.values())),
            )
            if jobs > 1
            else None
        )

    def __enter__(self) -> Replayer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def look(self, hypothesis: Hypothesis, coarse: bool = False) -> Replay:
        """Replay with everything that was recorded on the way, ``coarse`` at twice the step."""
        study = self.system.study
        try:
            plant = self.machine(hypothesis)
            if study.inverse:
                return inverse_replay(plant, study, self.measured)
            if coarse:
                plant.spec.option.timestep *= 2
            return replay(plant, study, self.measured, self._memory)
        except ValueError as error:  # a model that no longer compiles
            names = " and ".join(str(candidate) for candidate, _ in hypothesis)
            raise StudyError(f"the model with {names} does not compile: {error}") from error

    @property
    def drift(self) -> Floats:
        """What the model's time step does to its replay (n,) in SI units.

        A gap of the integrator, not of the model; Richardson's extrapolation from a half and a
        quarter of the step.
        """
        return self._drifts[0]

    @property
    def drift_error(self) -> Floats:
        """By how much the extrapolation has changed with the last halving (n,), in SI units."""
        return self._drifts[1]

    @cached_property
    def _drifts(self) -> tuple[Floats, Floats]:
        study = self.system.study
        if study.inverse:
            return np.zeros(len(self.measured.value)), np.zeros(len(self.measured.value))
        whole, half, quarter = (self._at_step(share) for share in (1.0, 0.5, 0.25))
        rough, fine = 2 * half - whole, 2 * quarter - half
        return np.nan_to_num(fine - whole), np.nan_to_num(fine - rough)

    def _at_step(self, share: float) -> Floats:
        """What the study's model predicts at a share of its time step (n,)."""
        plant = self.machine([])
        plant.spec.option.timestep *= share
        return replay(plant, self.system.study, self.measured).prediction

    def machine(self, hypothesis: Hypothesis) -> Plant:
        """The study's machine with a hypothesis and what is usual in it."""
        return build(self.system, [*self.usual, *hypothesis])

    @cached_property
    def usual(self) -> Hypothesis:
        """What every machine has and its drawing lacks; it is in all replays."""
        found: list[Part] = []
        for cause in CATALOGUE.values():
            alone = (
                location for location in cause.locations(self.system) if len(location.elements) == 1
            )
            for location in alone:
                parameters = cause.parameters(self.system, location)
                if any(p.usual for p in parameters):
                    beside = Location(location.kind, location.elements, USUAL)
                    values = {p.name: p.null + p.usual for p in parameters}
                    found.append((Candidate(cause, beside, parameters), values))
        return found

    def residual(self, hypothesis: Hypothesis) -> Floats:
        """Measured minus replayed (n,), in units of sensor noise; nan where it diverged.

        The error of the time step is taken out.
        """
        return self.residuals([hypothesis])[0]

    @property
    def coarse(self) -> bool:
        """Whether twice the model's time step will do for differences between replays."""
        if self._coarse is None:
            self._coarse = False
            if not self.system.study.inverse:
                change = self.look([], True).prediction - self.look([]).prediction
                usual = np.abs(self.drift) + self.measured.noise
                self._coarse = bool(
                    np.all(np.isfinite(change)) and np.mean(np.abs(change) / usual) < 3
                )
        return self._coarse

    def residuals(self, hypotheses: Sequence[Hypothesis], coarse: bool = False) -> list[Floats]:
        """The same of several hypotheses, in their order."""
        found = []
        for prediction in self._predictions(hypotheses, coarse):
            found.append((self.measured.value - prediction - self.drift) / self.measured.noise)
            self.tick()
        return found

    def predictions(self, study: Study, hypotheses: Sequence[Hypothesis]) -> list[Floats]:
        """What each would read in another study of the same machine (n,), in units of noise."""
        readings, count = measured(study), len(hypotheses)
        if self._pool is None:
            return [self.elsewhere(study, readings, one) for one in hypotheses]
        studies, locations = [study] * count, [readings] * count
        return list(self._pool.map(_predict_elsewhere, studies, locations, hypotheses))

    def elsewhere(self, study: Study, readings: Measured, hypothesis: Hypothesis) -> Floats:
        """What one hypothesis would read in another study (n,), of which these are the readings."""
        return replay(self.machine(hypothesis), study, readings).prediction / readings.noise

    def _predictions(self, hypotheses: Sequence[Hypothesis], coarse: bool) -> Iterator[Floats]:
        if self._pool is None or len(hypotheses) < 2:
            return (self.look(hypothesis, coarse).prediction for hypothesis in hypotheses)
        return self._pool.map(_predict, hypotheses, [coarse] * len(hypotheses), chunksize=1)


_replayer: Replayer | None = None


def _open(study: Study, causes: Sequence[Cause]) -> None:
    """In a worker: one workbench for all tasks, and the user's own causes in the catalogue."""
    global _replayer
    end_with_parent()
    silence()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for the answers is interrupted
    for cause in causes:
        if cause.id not in CATALOGUE:
            register(cause)
    _replayer = Replayer(study)


def _predict(hypothesis: Hypothesis, coarse: bool) -> Floats:
    assert _replayer is not None
    return _replayer.look(hypothesis, coarse).prediction


def _predict_elsewhere(study: Study, readings: Measured, hypothesis: Hypothesis) -> Floats:
    assert _replayer is not None
    return _replayer.elsewhere(study, readings, hypothesis)
