"""Calibration of the confidences of a diagnosis on simulated logs with hidden causes.

Confidences divide the evidence by a temper (`reality_gap.inference.confidence`). It is chosen such
that confidences are calibrated on logs that `reality_gap` simulates itself: the nominal model with
all tolerances sampled, one hidden cause, half the time step, and noise. Only the motion is that of
the diagnosis trials; their machines are not used.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from scipy.optimize import minimize_scalar

from experiments.gap_bench import run
from experiments.gap_bench.trial import Case, outcome, write_case
from experiments.harness.common import make_summary
from experiments.harness.criteria import expected_error
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Table, print_table
from experiments.harness.runner import core_seconds, run_tasks
from jmm_agent.types import Floats
from mjcf_sandbox.files import write_json
from reality_gap import Options, diagnose, load_study
from reality_gap.causes import CATALOGUE
from reality_gap.inference.confidence import TEMPER, tempered
from reality_gap.inference.screening import list_candidates
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.synthetic import simulate_study
from reality_gap.study.system import compile_system

NAME = "gap-calibrate"
SMALLEST, LARGEST = 0.03, 1.5
"""Size of a hidden cause, in scales of its parameters."""
FINER = 0.5
"""Time step of the simulation relative to that of the model."""
SHARPEST, DULLEST = 0.2, 100.0
"""Bounds of the temper."""
LEAST = 1e-6
"""Lower bound of probabilities, so that a single certain error does not dominate the loss."""


@dataclass(frozen=True)
class Args:
    """Calibration of the confidences of a diagnosis.

    Attributes:
        trials: number of trials, with one hidden cause each.
        seed: of the first trial; the others follow.
        out: folder of the results.
        jobs: number of parallel processes; the results do not depend on it.
        cluster: address of a Ray cluster that runs the trials instead; "auto" is the one that runs
            on this computer.
        quick: short logs that check the installation; their numbers mean nothing.
    """

    trials: int = 100
    seed: int = 0
    out: Path = Path("out") / NAME
    jobs: int = 2
    cluster: str | None = None
    quick: bool = False


def main(args: Args) -> dict[str, Any]:
    """Run the trials and fit the temper; writes summary.json and the result of each trial."""
    if args.trials < 1:
        raise ExperimentError(f"Trials are {args.trials}, but at least 1 is needed.")
    begin = time.perf_counter()
    seconds = run.QUICK_SECONDS if args.quick else 20.0
    tasks = {f"trial_{s}": (s, seconds) for s in range(args.seed, args.seed + args.trials)}
    key = run.digest(run.Args(seconds=seconds, kind=NAME))
    found = run_tasks(trial, tasks, args.jobs, args.out / "trials", key, args.cluster)
    trials = [t for t in found.values() if t["candidates"]]
    best = calibrated(trials)
    rows = [
        (name, f"{temper:.2f}", *_quality(trials, temper))
        for name, temper in (("present", TEMPER), ("calibrated", best))
    ]
    table = Table(
        "Temper of the confidences",
        ("", "temper", "log loss [nats]", "calibration error"),
        rows,
        f"{len(trials)} of {len(found)} diagnoses had candidates.",
    )
    summary = make_summary(
        NAME,
        {t["seed"]: t for t in found.values()},
        time.perf_counter() - begin,
        core_s=core_seconds(args.out / "trials", tasks),
        quick=args.quick,
        settings={**asdict(args), "out": args.out.name},
        calibrated=best,
        tables=[table.plain()],
    )
    write_json(args.out / "summary.json", summary)
    print_table(Console(), table)
    return summary


def trial(seed: int, seconds: float) -> dict[str, Any]:
    """Hide one cause in the simulation of a motion and diagnose it."""
    rng = np.random.default_rng([seed, 23])
    with tempfile.TemporaryDirectory() as name:
        write_case(Path(name), Case("null", seed, seconds=seconds))
        study = load_study(Path(name) / "STUDY.yaml")
        system = compile_system(study)
        known = list_candidates(system, list(CATALOGUE.values()))
        hidden = hide(rng, known)
        usual = [part for part in _sample_tolerances(rng, known) if part[0] is not hidden[0]]
        simulated = simulate_study(study, [*usual, hidden], rng, FINER)
        found = outcome(diagnose(simulated, options=Options(suggest=False)))
    candidate, values = hidden
    truth = {
        "cause": candidate.cause.id,
        "elements": list(candidate.location.elements),
        "values": values,
    }
    return {"seed": seed, "truth": truth} | found


def hide(
    rng: np.random.Generator, known: Sequence[Candidate]
) -> tuple[Candidate, dict[str, float]]:
    """Sample a cause uniformly, its location, and a size that is uniform in its logarithm."""
    ids = sorted({candidate.cause.id for candidate in known})
    name = str(rng.choice(ids))
    locations = [candidate for candidate in known if candidate.cause.id == name]
    candidate = locations[int(rng.integers(len(locations)))]
    size = np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST)))
    # Different for each parameter: equal friction in both directions is another cause.
    direction = rng.standard_normal(len(candidate.parameters))
    values = {}
    for p, share in zip(candidate.parameters, direction / np.abs(direction).max(), strict=True):
        if p.hints.starts:
            values[p.name] = float(rng.choice(p.hints.starts))
        else:
            value = p.null + size * share * p.scale
            values[p.name] = float(value if p.low <= value <= p.high else 2 * p.null - value)
    return candidate, values


def _sample_tolerances(
    rng: np.random.Generator, known: Sequence[Candidate]
) -> list[tuple[Candidate, dict[str, float]]]:
    """Sample errors of the nominal model within its tolerances."""
    found = []
    for candidate in known:
        if len(candidate.location.elements) > 1:
            continue
        values = {}
        for p in candidate.parameters:
            value = p.null + p.usual + p.tolerance * rng.standard_normal()
            inside = value if p.low <= value <= p.high else 2 * p.null - value
            values[p.name] = float(np.clip(inside, p.low, p.high))
        if any(p.tolerance for p in candidate.parameters):
            found.append((candidate, values))
    return found


def evidence_and_right(trial: Mapping[str, Any]) -> tuple[Floats, NDArray[np.bool_]]:
    """Evidence of the candidates of the first step against the null, and which were hidden.

    Returns:
        Shape (k,) each; the evidence in nats.
    """
    truth = trial["truth"]
    first = [
        (r, e) for r, e in zip(trial["candidates"], trial["evidence"], strict=True) if r[0] == 0
    ]
    return np.array([e for _, e in first]), np.array([r[1] == truth["cause"] for r, _ in first])


def calibrated(trials: Sequence[Mapping[str, Any]]) -> float:
    """The temper with which the hidden causes are most likely."""
    known = [evidence_and_right(t) for t in trials]

    def loss(x: float) -> float:
        return log_loss(known, float(np.exp(x)))

    ends = tuple(np.log([SHARPEST, DULLEST]))
    return float(np.exp(minimize_scalar(loss, bounds=ends, method="bounded").x))


def log_loss(known: Sequence[tuple[Floats, NDArray[np.bool_]]], temper: float) -> float:
    """Mean negative log probability of the hidden cause [nats]."""
    chances = [float(tempered(e, temper)[right].sum()) for e, right in known]
    return float(-np.mean(np.log(np.maximum(chances, LEAST))))


def _quality(trials: Sequence[Mapping[str, Any]], temper: float) -> tuple[str, str]:
    known = [evidence_and_right(t) for t in trials]
    confidence = np.array([tempered(e, temper).max() for e, _ in known])
    right = np.array([bool(r[np.argmax(e)]) for e, r in known])
    return f"{log_loss(known, temper):.3f}", f"{expected_error(confidence, right):.3f}"
