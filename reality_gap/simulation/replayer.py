"""Replayer: replays hypotheses of one study, several at a time, and computes their residuals."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cached_property, partial
from types import TracebackType
from typing import NamedTuple

import mujoco
import numpy as np

from mjcf_sandbox.parent_watchdog import end_with_parent
from reality_gap.causes import CATALOGUE, register_cause
from reality_gap.causes.base import Cause, Location, Record
from reality_gap.errors import StudyError
from reality_gap.simulation.episode import silence
from reality_gap.simulation.hypothesis import (
    Candidate,
    Hypothesis,
    Part,
    Plant,
    build,
    in_log,
)
from reality_gap.simulation.inverse_dynamics import ensure_prepared, inverse_replay
from reality_gap.simulation.light_model import light_spec, without_distant_meshes
from reality_gap.simulation.likelier_start import with_likelier_start
from reality_gap.simulation.needed_restarts import with_needed_restarts
from reality_gap.simulation.replay import RecordCache, Replay, replay
from reality_gap.study.data import Study
from reality_gap.study.measurements import (
    Measured,
    measured,
    rounding_steps,
    with_estimated_noise,
)
from reality_gap.study.rounding import with_shared_rounding
from reality_gap.study.system import System, compile_system, with_step
from reality_gap.types import Floats

Tick = Callable[[], None]

USUAL = "usual"
"""Note of the location of a usual effect; it distinguishes the location from a candidate's."""
FINER = (0.25, 0.125, 0.0625)
"""Shares of the time step to which it is refined, as far as predictions still change."""
SEEN = 0.3
"""RMS change of a channel by a refinement, relative to noise, above which it is refined again."""
TOO_COARSE = 25.0
"""RMS of the part of a channel's error that is not in proportion to the time step, from which on
replays use a finer step [noise]."""
MOST_HALVINGS = 2
"""How often the time step of replays is halved, at most."""
COARSER = 2.0
"""Multiple of the time step that is coarser."""
COARSE = 3.0
"""Mean change by a coarser time step, relative to drift and noise, up to which it is accurate
enough for differences between replays."""


class Expansion(NamedTuple):
    """Deviations within the tolerances about which residuals are linearised.

    Attributes:
        parts: k candidates with small values.
        effects: their linear effects, shape (k, n) in units of noise.
    """

    parts: tuple[Part, ...] = ()
    effects: Floats = np.zeros((0, 1))

    def beside(self, hypothesis: Hypothesis) -> Expansion:
        """Return the deviations without those of a hypothesis' own candidates.

        Their values are in the hypothesis, and may be as large as a fault is.
        """
        chosen = [c for c, _ in hypothesis]
        kept = [i for i, (c, _) in enumerate(self.parts) if not any(c.matches(o) for o in chosen)]
        return Expansion(tuple(self.parts[i] for i in kept), self.effects[kept])

    @property
    def shift(self) -> Floats:
        """Linear effect of all deviations, shape (n,) or (1,) [noise]."""
        return np.asarray(self.effects.sum(axis=0), dtype=np.float64)


class Discretisation(NamedTuple):
    """Error of replays due to the time step in SI units; each array has the shape (n,).

    Attributes:
        drift: what finer steps would change, by Richardson extrapolation from a half and a quarter
            of the step, and from smaller ones until this changes no more.
        last: change of the extrapolation with the last halving of the step.
        curvature: error of a replay at half the time step, less half of `drift`; it is zero where
            the error is in proportion to the step.
    """

    drift: Floats
    last: Floats
    curvature: Floats


class Replayer:
    """Replays hypotheses of one study.

    Args:
        study: model, commands and measurements.
        jobs: number of processes.
        tick: called after each replay.
        step: time step of replays over that of the study's model; chosen if None.

    Attributes:
        system: the study's model, with the time step of replays, and its elements.
        measured: all readings of the study.
        step: time step of replays over that of the study's model.
        model_error: error of replays of the nominal model with its own step, if they have another.
        tick: called after each replay.
        expansion: deviations in the replays of `residuals`; see `reality_gap.inference.expansion`.
        own_step: whether the log is a simulated one with the time step of replays, so that
            predictions are not extrapolated to finer steps, and dry friction is as soft as in
            simulations where efforts are compared.
    """

    def __init__(
        self,
        study: Study,
        jobs: int = 1,
        tick: Tick = lambda: None,
        step: float | None = None,
    ) -> None:
        study = ensure_prepared(study)
        self.system: System = compile_system(study)
        self.measured: Measured = measured(study)
        self.tick = tick
        self.expansion = Expansion()
        self.own_step = False
        self._cache = RecordCache()
        self._coarse: bool | None = None
        self.step: float = 1.0
        self.model_error: Discretisation | None = None
        if not study.inverse:
            study = self._settle(study, step)
        self._pool = (
            ProcessPoolExecutor(
                jobs,
                multiprocessing.get_context("forkserver"),
                _start_worker,
                initargs=(study, tuple(CATALOGUE.values()), self.step),
            )
            if jobs > 1
            else None
        )

    def _settle(self, study: Study, step: float | None) -> Study:
        """Choose the time step, unless it is given, and return the study as replays show it."""
        if step is not None:
            self._set_step(step)
            return self._settle_unknowns(study)
        given, readings = study, self.measured
        study = self._settle_unknowns(given)
        if self._refine():
            self.measured = readings
            study = self._settle_unknowns(given)
            self._set_step(self.step)
        return study

    def _settle_unknowns(self, study: Study) -> Study:
        """Return the study as replays of the nominal model show it.

        Where it was not stated, noise is estimated from the errors of the model. Errors by rounding
        that readings share count once.
        """
        before = mujoco.get_mju_user_warning()
        silence()

        def predict(study: Study) -> Floats:
            self.system = replace(self.system, study=study)
            return self._replay([], 1.0, None).prediction

        try:
            study = with_likelier_start(study, self.measured, predict)
            self.system = replace(self.system, study=study)
            if any(channel.noise is None for channel in study.channels):
                study = with_estimated_noise(study, self.measured, predict(study))
                self.system = replace(self.system, study=study)
                self.measured = measured(study)
            study = with_needed_restarts(study, self.measured, predict)
            self.system = replace(self.system, study=study)
            if study.restart:
                self.measured = measured(study)
            if np.any(rounding_steps(study) > 0.0):
                self.measured = with_shared_rounding(study, self.measured, predict(study))
        finally:
            mujoco.set_mju_user_warning(before)
        return study

    def _refine(self) -> bool:
        """Halve the time step of replays where its error cannot be extrapolated away.

        As where a joint rests against one stop or another, a large part of the error is not in
        proportion to the step then, or the replay diverges. A log that is nearer to replays with
        the model's own step, as one that was simulated with it, keeps this step.

        Returns:
            Whether the step changed.
        """
        before = mujoco.get_mju_user_warning()
        silence()
        try:
            if not self._is_too_coarse():
                return False
            whole, noise = self.replay([]).prediction, self.measured.noise
            own = (self.measured.value - whole) / noise
            if np.sum((own - self.drift / noise) ** 2) >= np.sum(own**2):
                return False
            self.model_error = self.step_error
            for _ in range(MOST_HALVINGS):
                self._set_step(0.5 * self.step)
                if not self._is_too_coarse():
                    break
            return True
        finally:
            mujoco.set_mju_user_warning(before)

    def _is_too_coarse(self) -> bool:
        """Return whether replays diverge only at this time step, or have a large error of it."""
        whole, half = (self.replay([], share).prediction for share in (1.0, 0.5))
        if not np.isfinite(half).all():
            return False
        if not np.isfinite(whole).all():
            return True
        # Most models need no more than this one replay.
        if self._rms_of_channels(half - whole).max() <= TOO_COARSE:
            return False
        return bool(self._rms_of_channels(self.drift_curvature).max() > TOO_COARSE)

    def _set_step(self, step: float) -> None:
        """Set the time step of replays over that of the study's model."""
        self.system = with_step(self.system, step / self.step)
        self.step = step
        for name in ("step_error", "_coarser", "_light", "usual"):
            self.__dict__.pop(name, None)

    def __enter__(self) -> Replayer:
        self._warned = mujoco.get_mju_user_warning()
        silence()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        mujoco.set_mju_user_warning(self._warned)
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def replay(self, hypothesis: Hypothesis, step: float = 1.0) -> Replay:
        """Replay the study under a hypothesis.

        Args:
            hypothesis: candidates with their values.
            step: physics step, relative to the model's.

        Returns:
            The predicted readings and the simulated signals.

        Raises:
            StudyError: the model does not compile with these candidates.
        """
        logs = dict.fromkeys(candidate.location.log for candidate, _ in hypothesis)
        own = [log for log in logs if log]
        if own:
            return self._stitch(hypothesis, own, step)
        return self._replay(hypothesis, step, None)

    def _stitch(self, hypothesis: Hypothesis, logs: Sequence[str], step: float) -> Replay:
        """Replay each of some logs with its own causes, and all others without these."""
        study = self.system.study
        episodes = {log: study.episodes_of(log) for log in logs}
        taken = {e for some in episodes.values() for e in some}
        rest = tuple(e for e in range(len(study.episodes)) if e not in taken)
        prediction = np.full(len(self.measured.value), np.nan)
        records = dict[int, Record]()
        for log, some in {"": rest, **episodes}.items():
            if not some:
                continue
            found = self._replay(in_log(hypothesis, log), step, some)
            at = np.isin(self.measured.episode, some)
            prediction[at] = found.prediction[at]
            records.update(zip(some, found.records, strict=True))
        return Replay(prediction, tuple(records[e] for e in sorted(records)))

    def _replay(self, hypothesis: Hypothesis, step: float, only: Collection[int] | None) -> Replay:
        study = self.system.study
        try:
            plant = self.light_plant(hypothesis, 1.0 if study.inverse else step)
            if study.inverse:
                return inverse_replay(plant, study, self.measured, only, self.own_step)
            return replay(plant, study, self.measured, self._cache if step >= 1.0 else None, only)
        except ValueError as error:  # MuJoCo's, if the model does not compile
            names = " and ".join(str(candidate) for candidate, _ in hypothesis)
            raise StudyError(f"the model with {names} does not compile: {error}") from error

    @property
    def drift(self) -> Floats:
        """Error of replays due to the time step in SI units, shape (n,); see `Discretisation`.

        This part of the gap belongs to the integrator, not to the model. It is zero if the log has
        the model's own step.
        """
        return self.step_error.drift * (not self.own_step)

    @property
    def drift_error(self) -> Floats:
        """Change of the extrapolation with the last halving of the step in SI units, shape (n,)."""
        return self.step_error.last * (not self.own_step)

    @property
    def drift_curvature(self) -> Floats:
        """Part of the error that is not in proportion to the step in SI units, shape (n,)."""
        return self.step_error.curvature * (not self.own_step)

    @cached_property
    def step_error(self) -> Discretisation:
        """Error of replays due to the time step: that of the nominal model, unless it was set."""
        return self.step_error_of([])

    def step_error_of(self, hypothesis: Hypothesis) -> Discretisation:
        """Return the error of the time step in replays of a hypothesis.

        Args:
            hypothesis: candidates with their values.
        """
        if self.system.study.inverse:
            return Discretisation(*np.zeros((3, len(self.measured.value))))

        def at_step(share: float) -> Floats:
            return self.replay(hypothesis, share).prediction

        whole, half = at_step(1.0), at_step(0.5)
        fine, error, last = 2 * half - whole, np.zeros(len(whole)), half
        for share in FINER:
            finer = at_step(share)
            error, fine, last = 2 * finer - last - fine, 2 * finer - last, finer
            if not self._is_seen(error):
                break
        drift = np.nan_to_num(fine - whole)
        curvature = np.nan_to_num(fine - half) - 0.5 * drift
        return Discretisation(drift, np.nan_to_num(error), curvature)

    def _is_seen(self, error: Floats) -> bool:
        """Return whether an error of predictions (n,) is seen beside the noise of any channel."""
        return bool(self._rms_of_channels(error).max() > SEEN)

    def _rms_of_channels(self, error: Floats) -> Floats:
        """Return the RMS of an error (n,) in each channel with readings, shape (c,) [noise]."""
        channel = self.measured.channel
        squares = np.bincount(channel, (error / self.measured.noise) ** 2)
        counts = np.bincount(channel)
        return np.asarray(np.sqrt(squares[counts > 0] / counts[counts > 0]))

    def change_of_start(self, moved: Study, hypothesis: Hypothesis = ()) -> Floats:
        """Return how a prediction changes if the same study begins in other states.

        Args:
            moved: the study with other states.
            hypothesis: candidates with their values; none for the nominal prediction.

        Returns:
            Change in SI units, shape (n,); 0 where the replay diverged.
        """
        plant = self.light_plant(hypothesis)
        prediction = replay(plant, moved, self.measured).prediction
        return np.nan_to_num(prediction - self.replay(hypothesis).prediction)

    def plant(self, hypothesis: Hypothesis) -> Plant:
        """Build the study's model with the usual effects and a hypothesis."""
        return build(self.system, [*self.usual, *hypothesis])

    def light_plant(self, hypothesis: Hypothesis, step: float = 1.0) -> Plant:
        """Build the same plant without visual elements; see `light_spec`.

        Args:
            hypothesis: candidates with their values.
            step: physics step, relative to the model's.
        """
        return build(self._at(step), [*self.usual, *hypothesis], self._light)

    def _at(self, step: float) -> System:
        """Return the system with a physics step that is relative to the model's."""
        if step == 1.0:
            return self.system
        return self._coarser if step == COARSER else with_step(self.system, step)

    @cached_property
    def _coarser(self) -> System:
        """The system with a coarser step; those with finer ones are used a few times only."""
        return with_step(self.system, COARSER)

    @cached_property
    def _light(self) -> mujoco.MjSpec:
        """The study's model without visual elements, and without meshes that touch nothing."""
        study = self.system.study
        light = light_spec(study.spec(), contacts=not study.inverse)
        if study.inverse or not light.meshes:
            return light
        found = replay(build(self.system, self.usual, light), study, self.measured)
        qpos = np.concatenate([record.qpos for record in found.records])
        return without_distant_meshes(light, qpos) if np.isfinite(qpos).all() else light

    @cached_property
    def usual(self) -> Hypothesis:
        """Effects that all machines have and nominal models lack; they are in all replays."""
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
        """Return measured minus replayed readings in units of sensor noise, shape (n,).

        The error of the time step is subtracted. Where the replay diverged it is NaN.
        """
        return self.residuals([hypothesis])[0]

    def without_expansion(self, hypothesis: Hypothesis, residual: Floats) -> Floats:
        """Return the residual of a replay without the expansion, shape (n,).

        Args:
            hypothesis: candidates with their values.
            residual: its residual with the expansion, shape (n,).
        """
        kept = self.expansion
        if not kept.parts:
            return residual
        self.expansion = Expansion()
        try:
            return self.residual(hypothesis)
        finally:
            self.expansion = kept

    @property
    def coarse(self) -> bool:
        """Whether a doubled time step is accurate enough for differences between replays."""
        if self._coarse is None:
            self._coarse = False
            if not self.system.study.inverse:
                change = self.replay([], COARSER).prediction - self.replay([]).prediction
                scale = np.abs(self.drift) + self.measured.noise
                self._coarse = bool(
                    np.all(np.isfinite(change)) and np.mean(np.abs(change) / scale) < COARSE
                )
        return self._coarse

    def residuals(self, hypotheses: Sequence[Hypothesis], coarse: bool = False) -> list[Floats]:
        """Return the residuals of several hypotheses, in their order; see `residual`."""
        found, step = [], COARSER if coarse else 1.0
        beside = [self.expansion.beside(one) for one in hypotheses]
        deviating = [[*e.parts, *one] for e, one in zip(beside, hypotheses, strict=True)]
        predictions = self._predictions(deviating, step)
        for expansion, prediction in zip(beside, predictions, strict=True):
            residual = (self.measured.value - prediction - self.drift) / self.measured.noise
            found.append(residual + expansion.shift)
            self.tick()
        return found

    def predictions(self, study: Study, hypotheses: Sequence[Hypothesis]) -> list[Floats]:
        """Predict the readings of another study of the same machine, to tell hypotheses apart.

        The time step is doubled where that is accurate enough for their differences.

        Args:
            study: commands and times of the readings; their values are not used.
            hypotheses: candidates with their values.

        Returns:
            The prediction of each hypothesis in units of sensor noise, shape (n,).
        """
        predict = partial(_predict_study, study, measured(study))
        if self._pool is None:
            return [predict(one, self) for one in hypotheses]
        return list(self._pool.map(predict, hypotheses))

    def _predictions(self, hypotheses: Sequence[Hypothesis], step: float) -> Iterator[Floats]:
        if self._pool is None or len(hypotheses) < 2:
            return (self.replay(hypothesis, step).prediction for hypothesis in hypotheses)
        return self._pool.map(partial(_predict, step, self.own_step), hypotheses, chunksize=1)


_replayer: Replayer | None = None
"""In a worker process: the replayer of all its tasks."""


def _start_worker(study: Study, causes: Sequence[Cause], step: float) -> None:
    """Make the worker's replayer, and add the user's own causes to its catalogue."""
    global _replayer
    end_with_parent()
    silence()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles the interruption
    for cause in causes:
        if cause.id not in CATALOGUE:
            register_cause(cause)
    _replayer = Replayer(study, step=step)


def _predict(step: float, own_step: bool, hypothesis: Hypothesis) -> Floats:
    assert _replayer is not None
    _replayer.own_step = own_step
    return _replayer.replay(hypothesis, step).prediction


def _predict_study(
    study: Study, readings: Measured, hypothesis: Hypothesis, replayer: Replayer | None = None
) -> Floats:
    """Predict the readings of another study in units of noise, by default in a worker."""
    found = replayer or _replayer
    assert found is not None
    plant = found.light_plant(hypothesis, COARSER if found.coarse else 1.0)
    return replay(plant, study, readings).prediction / readings.noise
