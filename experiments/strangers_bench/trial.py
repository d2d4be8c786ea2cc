"""Trial of the strangers' bench: effects are hidden in a machine of a seed, which is diagnosed."""

from __future__ import annotations

import math
import resource
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness.errors import ExperimentError
from hidden_plants.secret import Effect
from hidden_plants.strangers import KINDS, Oracle, Secret, Stranger, make_stranger, sample_secret
from hidden_plants.strangers.study import write_study
from hidden_plants.strangers.truth import true_size
from reality_gap import Diagnosis, Options, diagnose, load_study
from reality_gap.errors import RealityGapError
from reality_gap.simulation.episode import silence

TRIES = 5
"""Largest number of machines that are made for one trial, if a machine shows no effect."""
NEXT = 1_000_000
"""Distance of the seeds of these machines."""


@dataclass(frozen=True)
class Case:
    """Specification of a trial.

    Attributes:
        kind: "single", "pair", "null" or "outside".
        seed: of the machine, and of what is hidden in it.
        seconds: length of the log [s].
        family: id of the (first) effect; any by default.
        limit: longest time of the diagnosis [s].
    """

    kind: str
    seed: int
    seconds: float = 10.0
    family: str | None = None
    limit: float = math.inf


@dataclass(frozen=True)
class Hidden:
    """A machine and what is hidden in it."""

    stranger: Stranger
    secret: Secret


def hide(case: Case) -> Hidden:
    """Make the machine of a case and hide effects in it.

    Raises:
        ExperimentError: the kind or family is unknown, or no machine shows such an effect.
    """
    # The oracle tries amplitudes with which a machine diverges; that is recognised by NaN.
    silence()
    reason = ""
    for attempt in range(TRIES):
        stranger = make_stranger(case.seed + attempt * NEXT, case.seconds)
        rng = np.random.default_rng([case.seed, KINDS.index(case.kind), 7])
        try:
            oracle = Oracle(stranger)
            secret = sample_secret(rng, stranger, oracle, case.kind, case.family)
        except ValueError as error:
            reason = str(error)
        else:
            return Hidden(stranger, secret)
    raise ExperimentError(f"strangers-bench, seed {case.seed}: {reason}.")


def trial(case: Case) -> dict[str, Any]:
    """Hide effects, write the study and diagnose it; returns truth and answer as JSON."""
    hidden = hide(case)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_study(folder, hidden.stranger, hidden.secret.effects)
        options = Options(suggest=False, time_limit=case.limit)
        used = time.process_time()
        try:
            study = load_study(folder / "STUDY.yaml")
            found = outcome(diagnose(study, options=options))
        except RealityGapError as error:
            found = refused(str(error).replace(str(folder), "."))
    found["core_seconds"] = time.process_time() - used
    found["memory"] = peak_memory()
    return {"case": asdict(case), "machine": machine(hidden.stranger)} | truths(hidden) | found


def machine(stranger: Stranger) -> dict[str, Any]:
    """Traits of a machine, for tables."""
    traits = asdict(stranger.traits)
    elements = {name: [name.removeprefix("m_")] for name in stranger.actuators}
    elements |= {sensor.name: [_bare(sensor.name)] for sensor in stranger.sensors}
    for route in stranger.routes:
        for step in route.path:
            elements[step] = [route.name]
    return {
        "seed": stranger.seed,
        **{key: traits[key] for key in ("kind", "joints", "reach", "rate", "position_bits")},
        **{key: traits[key] for key in ("integrator", "noise_stated", "tricky_defaults")},
        "tendons": len(stranger.routes),
        "step": stranger.design.step,
        "elements": elements,
    }


def _bare(sensor: str) -> str:
    """Name of the joint or tendon that a sensor measures."""
    for prefix in ("length_", "force_", "speed_", "at_"):
        sensor = sensor.removeprefix(prefix)
    return sensor


def truths(hidden: Hidden) -> dict[str, Any]:
    """The hidden effects as JSON."""
    pairs = zip(hidden.secret.effects, hidden.secret.multiples, strict=True)
    return {"truth": [truth(hidden.stranger, effect, multiple) for effect, multiple in pairs]}


def truth(stranger: Stranger, effect: Effect, multiple: float) -> dict[str, Any]:
    """A hidden effect as JSON; ``multiple`` is its amplitude over the oracle's floor."""
    return {
        "effect": effect.id,
        "elements": list(effect.elements),
        "parameters": dict(effect.parameters),
        "size": true_size(stranger, effect),
        "multiple": multiple if np.isfinite(multiple) else None,
    }


def outcome(found: Diagnosis) -> dict[str, Any]:
    """The answer of a diagnosis as JSON."""
    return {
        "verdict": found.verdict.value,
        "reason": "",
        "causes": [
            {
                "cause": c.candidate.cause.id,
                "elements": list(c.candidate.location.elements),
                "note": c.candidate.location.note,
                "parameters": {name: [e.value, e.low, e.high] for name, e in c.parameters.items()},
                "confidence": c.confidence,
                "equivalent": list(c.equivalent),
            }
            for c in found.causes
        ],
        "candidates": [
            [r.step, r.candidate.cause.id, list(r.candidate.location.elements), r.score]
            for r in found.fitted_candidates[:12]
        ],
        "rms": [found.rms_before, found.rms_after, found.noise_floor],
        "measures": dict(found.measures),
    }


def refused(reason: str) -> dict[str, Any]:
    """The answer of a study that is refused, as JSON."""
    return {
        "verdict": "refused",
        "reason": reason,
        "causes": [],
        "candidates": [],
        "rms": [None, None, None],
        "measures": {},
    }


def peak_memory() -> float:
    """Largest memory of this process so far [MB]."""
    unit = 1024.0**2 if sys.platform == "darwin" else 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
