"""Trial of the diagnosis: effects are hidden in a machine, and its log is diagnosed."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import hidden_plants
from experiments.gap_bench.baselines import Named, free_parameter_baseline, largest_correlation
from experiments.gap_bench.length_errors import bend, length_error
from experiments.gap_bench.scores import AMBIGUOUS, ASSETS, entropy
from experiments.harness.errors import ExperimentError
from hidden_plants import Effect, Nuisance, Secret, Truth
from jmm_agent.types import Floats
from reality_gap import Diagnosis, Options, diagnose, load_study
from reality_gap.inference.held_out import score
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import build
from reality_gap.simulation.replay import replay
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import measured

KINDS = ("single", "pair", "null", "outside")
EXACT = 1e-6
"""Noise of the readings of the true model, relative to the usual one; a study needs some noise."""


@dataclass(frozen=True)
class Case:
    """Specification of the hidden effects.

    Attributes:
        kind: "single", "pair", "null" or "outside".
        seed: of the sampled effects, the mismatches and the noise.
        machine: "elbow" or "arm".
        seconds: length of the log [s].
        family: id or family of the (first) effect; any by default.
    """

    kind: str
    seed: int
    machine: str = "elbow"
    seconds: float = 20.0
    family: str | None = None

    def secret(self) -> Secret:
        """Effects of this case, which are determined by it.

        Raises:
            ExperimentError: the family is unknown, or the machine shows no effect of it.
        """
        rng = np.random.default_rng([self.seed, KINDS.index(self.kind), 7])
        try:
            return hidden_plants.sample_secret(rng, self.kind, self.machine, self.family)
        except ValueError as error:
            raise ExperimentError(f"gap-bench: {error}.") from error


def write_case(folder: Path, case: Case, nuisance: Nuisance | None = None) -> Truth:
    """Write the study of a case into ``folder``; returns the truth, which is not in it."""
    return hidden_plants.write_study(
        folder, case.secret(), case.seed, case.machine, ASSETS, case.seconds, nuisance, False
    )


@dataclass
class Inputs:
    """Inputs of a diagnosis, for true model and baselines.

    Attributes:
        replayer: of the study.
        null: residual of the nominal model, shape (n,).
        found: sensitivities from the screening.
    """

    replayer: Replayer | None = None
    null: Floats = field(default_factory=lambda: np.zeros(0))
    found: Sequence[Sensitivity] = ()

    def keep(self, replayer: Replayer, null: Floats, found: Sequence[Sensitivity]) -> None:
        """Store the inputs; the ``watch`` callback of `diagnose`."""
        self.replayer, self.null, self.found = replayer, null, found


def trial(case: Case, options: Options | None = None, jobs: int = 1) -> dict[str, Any]:
    """Hide effects and diagnose the log; returns truth and diagnosis as numbers for JSON."""
    with tempfile.TemporaryDirectory() as name:
        truth = write_case(Path(name), case)
        found = diagnose(load_study(Path(name) / "STUDY.yaml"), jobs=jobs, options=options)
    return _truths(case, truth.secret) | outcome(found)


def compared_trial(case: Case, followup: bool, free: bool) -> dict[str, Any]:
    """Run a trial with true model and baselines on the same log.

    Args:
        case: what is hidden.
        followup: whether to run the suggested experiment and diagnose again.
        free: whether to fit all parameters at once, too, which is slow.
    """
    inputs = Inputs()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        truth = write_case(folder, case)
        study, options = load_study(folder / "STUDY.yaml"), Options(suggest=followup)
        found = diagnose(study, options=options, watch=inputs.keep)
        again = follow(folder, case, found) if followup else None
    assert inputs.replayer is not None
    baselines: dict[str, Named | None] = {
        "correlation": largest_correlation(inputs.replayer.measured, inputs.null, inputs.found),
        "free_parameters": free_parameter_baseline(inputs.replayer, inputs.found) if free else None,
    }
    return (
        _truths(case, truth.secret)
        | outcome(found)
        | {
            "true_model": true_model(case, inputs) if truth.secret.effects else None,
            "length_error": length_error(truth, found, ASSETS),
            "bend": bend(truth, found, ASSETS),
            "followup": again,
            "baselines": {k: None if b is None else asdict(b) for k, b in baselines.items()},
        }
    )


def true_model(case: Case, inputs: Inputs) -> dict[str, float | None]:
    """RMS and gain of the nominal model with the hidden effects and without mismatches."""
    assert inputs.replayer is not None
    nuisance = Nuisance().scaled(EXACT)
    with tempfile.TemporaryDirectory() as name:
        write_case(Path(name), case, nuisance)
        exact = measured(load_study(Path(name) / "STUDY.yaml")).value
    system, readings = inputs.replayer.system, inputs.replayer.measured
    nominal = replay(build(system, []), system.study, readings).prediction
    usual = inputs.replayer.replay([]).prediction - nominal  # part of all replays of the diagnosis
    after = (readings.value - readings.align(exact) - usual) / readings.noise
    scored = score(system.study, readings, inputs.null, after)
    return {"rms": scored.after, "gain": None if scored.gain is None else scored.gain.value}


def follow(folder: Path, case: Case, found: Diagnosis) -> dict[str, Any] | None:
    """Run the suggested experiment on the machine and diagnose both logs together.

    None where the first diagnosis is certain.
    """
    advice, unsure = found.next_experiment, entropy(outcome(found))
    if advice is None or unsure is None or unsure < AMBIGUOUS:
        return None
    hidden_plants.run(
        folder, case.secret(), case.seed, advice.time, advice.command, case.machine, ASSETS
    )
    again = diagnose(load_study(folder / "STUDY.yaml"), options=Options(suggest=False))
    return {"title": advice.title} | outcome(again)


def _truths(case: Case, secret: Secret) -> dict[str, Any]:
    return {"case": asdict(case), "truth": [_truth(e) for e in secret.effects]}


def _truth(effect: Effect) -> dict[str, Any]:
    return {
        "cause": effect.id,
        "elements": list(effect.elements),
        "parameters": dict(effect.parameters),
        "amplitude": effect.amplitude,
    }


def outcome(found: Diagnosis) -> dict[str, Any]:
    """Numbers of a diagnosis that are evaluated, for JSON."""
    return {
        "verdict": found.verdict.value,
        "causes": [
            {
                "cause": c.candidate.cause.id,
                "elements": list(c.candidate.location.elements),
                "elsewhere": [list(location.elements) for location in c.elsewhere],
                "note": c.candidate.location.note,
                "parameters": {name: [e.value, e.low, e.high] for name, e in c.parameters.items()},
                "confidence": c.confidence,
                "equivalent": list(c.equivalent),
            }
            for c in found.causes
        ],
        "candidates": [
            [
                r.step,
                r.candidate.cause.id,
                list(r.candidate.location.elements),
                r.score,
                r.confidence,
            ]
            for r in found.fitted_candidates
        ],
        "evidence": [r.evidence for r in found.fitted_candidates],
        "rms": [found.rms_before, found.rms_after, found.noise_floor],
        "gain": None if found.gain is None else found.gain.value,
        "unexplained": found.unexplained_fraction,
        "measures": dict(found.measures),
        "seconds": found.seconds,
    }
