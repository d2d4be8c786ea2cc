"""A commissioning run of a robot, driven step by step, and its result."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from jmm_agent.commissioning import findings as kinds
from jmm_agent.commissioning import sentences
from jmm_agent.commissioning.diagnosis import diagnose
from jmm_agent.commissioning.findings import Finding
from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.commissioning.posture_fit import likelihood_at_best
from jmm_agent.commissioning.pull_record import PullRecord
from jmm_agent.commissioning.pulls import PullSequence
from jmm_agent.commissioning.wiring import Wiring
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.length_check import beyond_map
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.muscle_order import MuscleOrder
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats

SAMPLES = 200
"""Number of postures, uniform between the joint limits, over which lengths are taken."""
MENDED = (kinds.SWAPPED, kinds.REVERSED, kinds.ABSENT, kinds.MOTOR_DEAD)
"""Kinds of findings that an agent can undo by itself."""


class CommissioningError(AgentError):
    """A robot with faults that an agent cannot undo."""


@dataclass(frozen=True, eq=False)
class Commissioning:
    """Result of a commissioning run.

    Attributes:
        muscles: names of the m muscles.
        findings: what is wrong.
        undecided: what the pulls do not show.
        seconds: duration by the robot's clock [s].
        largest_tension: [N].
        wiring: which muscle each channel moves and reads.
        predicted: responses of the lengths by the nominal map, as a share of the stroke (m, m) [1];
            row k is muscle k while muscle i, the column, is pulled.
        measured: the same as measured; NaN where a muscle was not pulled enough.
        record: what was measured; None if nothing was pulled.
    """

    muscles: tuple[str, ...]
    findings: tuple[Finding, ...]
    undecided: tuple[Finding, ...]
    seconds: float
    largest_tension: float
    wiring: Wiring
    predicted: Floats
    measured: Floats
    record: PullRecord | None = None

    @property
    def order(self) -> MuscleOrder:
        """Order and signs that undo what was found; absent muscles are left out.

        Raises:
            CommissioningError: something was found that order and signs do not undo.
        """
        left = [each for each in self.findings if each.kind not in MENDED]
        if left:
            more = f" (and {len(left) - 1} more)" if len(left) > 1 else ""
            raise CommissioningError(
                f"The robot has a fault that no order of its muscles undoes{more}: "
                f"{left[0].sentence} Then repeat the commissioning run."
            )
        wiring = self.wiring
        present = np.flatnonzero(~wiring.idle)
        commands, lengths, tensions = (
            np.argsort(order)[present]
            for order in (wiring.commands, wiring.lengths, wiring.tensions)
        )
        return MuscleOrder(
            tuple(self.muscles[index] for index in present),
            len(self.muscles),
            commands,
            lengths,
            tensions,
            np.sign(wiring.command_factors[commands]),
            np.sign(wiring.length_factors[lengths]),
            np.sign(wiring.tension_factors[tensions]),
        )

    @property
    def absent(self) -> tuple[str, ...]:
        """Names of the muscles that are absent, or whose motors do nothing."""
        return tuple(
            name for name, absent in zip(self.muscles, self.wiring.idle, strict=True) if absent
        )

    def __str__(self) -> str:
        """A line for each finding, and one for the run."""
        lines = [f"{each.kind}: {each.sentence}" for each in self.findings]
        lines += [f"undecided: {each.sentence}" for each in self.undecided]
        count = Counter(each.kind for each in self.findings)
        summary = ", ".join(f"{number} {kind}" for kind, number in count.items()) or "no fault"
        lines.append(
            f"{len(self.muscles)} muscles in {self.seconds:.0f} s, at most "
            f"{self.largest_tension:.0f} N: {summary} found."
        )
        return "\n".join(lines)


class Commissioner:
    """Gives the commands of a commissioning run from readings, and then its result.

    Args:
        jmm: the nominal joint-muscle mapping.
        joint_limits: lowest and highest angle of each joint (n, 2) [rad].
        posture: joint angles (n,) [rad] at which the robot is, about.
        motors: gains and limit.
        options: how muscles are pulled; the defaults if left out.
        held: target lengths (m,) [m] that the motors hold now; the first readings if left out.

    Raises:
        AgentError: the posture or ``held`` is not finite or of the wrong shape.
    """

    def __init__(
        self,
        jmm: JointMuscleMap,
        joint_limits: Floats,
        posture: Floats,
        motors: MotorControl,
        options: CommissionOptions | None = None,
        held: Floats | None = None,
    ) -> None:
        self._options = options = options or CommissionOptions()
        low, high = np.asarray(joint_limits, dtype=float).T
        posture = _finite("posture", posture, len(low))
        held = None if held is None else _finite("held", held, len(jmm.muscles))
        lengths = jmm.lengths(np.random.default_rng(0).uniform(low, high, (SAMPLES, len(low))))
        self._low, self._high = lengths.min(axis=0), lengths.max(axis=0)
        travel = float(np.median(lengths.std(axis=0)))
        self._muscles = jmm.muscles
        self._pulls = PullSequence(jmm.muscles, motors, travel, options, held)
        self._jmm, self._joint_limits, self._posture = jmm, joint_limits, posture
        self._refused: tuple[Finding, ...] | None = None

    @property
    def done(self) -> bool:
        """Whether nothing is left to be commanded."""
        return bool(self._refused) or self._pulls.done

    @property
    def stage(self) -> str:
        """What is done now, in a few words."""
        return self._pulls.stage

    def refuse(self, readings: SensorReadings) -> bool:
        """Whether nothing may be commanded, because an encoder reads no possible length.

        `done` and `result` then hold, and no command was given.

        Args:
            readings: the first ones.
        """
        readings = readings.checked(-np.inf, len(self._muscles), gaps=True)
        lengths, found = readings.lengths, list[Finding]()
        beyond = beyond_map(lengths, self._low, self._high) > 1.0
        for index in np.flatnonzero(beyond | ~np.isfinite(lengths)):
            name, low, high = self._muscles[index], self._low[index], self._high[index]
            if np.isfinite(lengths[index]):
                sentence = sentences.far_length(name, lengths[index], low, high)
                kind = kinds.ENCODER_SCALE
            else:
                kind, sentence = kinds.ENCODER_DEAD, sentences.no_number(name)
            found.append(Finding(kind, (name,), sentence, confidence=1.0))
        self._refused = tuple(found)
        return bool(found)

    def step(self, readings: SensorReadings) -> Floats:
        """Run one control step.

        Args:
            readings: of m muscles; those that are not later than the ones before are skipped.

        Returns:
            Target muscle lengths (m,) [m] for the next control period.

        Raises:
            CommissioningError: the first readings have no possible length of a muscle.
            AgentError: readings of the wrong shape, or none of the lengths is finite.
        """
        if self._refused is None:
            self.refuse(readings)
        if self._refused:
            raise CommissioningError(self._refused[0].sentence)
        return self._pulls.step(readings)

    def result(self) -> Commissioning:
        """What was found.

        Raises:
            AgentError: the run is not done.
        """
        if not self.done:
            raise AgentError(
                f"Commissioner: the run is at {self.stage!r}; call step until done is True."
            )
        count = len(self._muscles)
        if self._refused:
            unknown = np.full((count, count), np.nan)
            healthy = Wiring.healthy(count)
            return Commissioning(
                self._muscles, self._refused, (), 0.0, 0.0, healthy, unknown, unknown
            )
        record = self._pulls.record
        likelihood = likelihood_at_best(
            record, self._jmm, self._joint_limits, self._posture, self._options
        )
        wiring, found, undecided = diagnose(likelihood, self._options)
        return Commissioning(
            self._muscles,
            tuple(found),
            tuple(undecided),
            record.duration,
            record.largest_tension,
            wiring,
            likelihood.predicted(Wiring.healthy(count)).mean,
            likelihood.lengths,
            record,
        )


def _finite(name: str, given: Floats, count: int) -> Floats:
    """An argument as finite numbers (count,)."""
    array = np.array(given, dtype=float)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise AgentError(
            f"Commissioner: {name} must be {count} finite numbers; got shape {array.shape}."
        )
    return array
