"""How sure a diagnosis may be: causes are hidden in the drawing's own replays, and found again.

The confidence divides evidence by a temper (`reality_gap.inference.confidence`). Here it is set so
that confidences keep their word on machines that `reality_gap` simulates itself: the drawing with
every tolerance drawn at random, one cause in it, half the time step, and noise. Only the motion is
that of the bench; nothing of its machines is.
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
from experiments.gap_bench.criteria import expected_error
from experiments.gap_bench.trial import Case, outcome, write_case
from experiments.harness.common import make_summary
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Table, print_table
from experiments.harness.runner import core_seconds, run_tasks
from jmm_agent.types import Floats
from mjcf_sandbox.files import write_json
from reality_gap import Options, diagnose, load_study
from reality_gap.causes import CATALOGUE
from reality_gap.inference.confidence import TEMPER, tempered
from reality_gap.inference.screening import candidates
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.synthetic import simulate
from reality_gap.study.system import look_at

NAME = "gap-calibrate"
SMALLEST, LARGEST = 0.03, 1.5
"""Size of a hidden cause, in scales of its parameters."""
FINER = 0.5
"""Time step of what is simulated, over the model's."""
SHARPEST, DULLEST = 0.2, 100.0
"""Tempers between which the best is looked for."""
LEAST = 1e-6
"""Probability that nothing is less likely than: a sure error must not count for all."""


@dataclass(frozen=True)
class Args:
    """What the calibration takes.

    Attributes:
        trials: how many causes are hidden, one after the other.
        seed: of the first trial; the others follow.
        out: folder of the results.
        jobs: trials at the same time; the result does not depend on it.
        cluster: address of a Ray cluster that does it instead; "auto": the one that runs here.
        quick: short logs, to see that it works; the numbers mean nothing then.
    """

    trials: int = 100
    seed: int = 0
    out: Path = Path("out") / NAME
    jobs: int = 2
    cluster: str | None = None
    quick: bool = False


def main(args: Args) -> dict[str, Any]:
    """Hide, diagnose, and set the temper; writes summary.json and the trials."""
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
        (name, f"{temper:.2f}", *_told(trials, temper))
        for name, temper in (("as it is", TEMPER), ("calibrated", best))
    ]
    table = Table(
        "Temper of the confidences",
        ("", "temper", "log loss [nats]", "calibration error"),
        rows,
        f"{len(trials)} of {len(found)} hidden causes were looked for further.",
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
    """Hide one cause in the drawing's replay of a motion, and diagnose it."""
    rng = np.random.default_rng([seed, 23])
    with tempfile.TemporaryDirectory() as name:
        write_case(Path(name), Case("null", seed, seconds=seconds))
        study = load_study(Path(name) / "STUDY.yaml")
        system = look_at(study)
        known = candidates(system, list(CATALOGUE.values()))
        hidden = hide(rng, known)
        honest = [part for part in _honest(rng, known) if part[0] is not hidden[0]]
        told = simulate(study, [*honest, hidden], rng, FINER)
        found = outcome(diagnose(told, options=Options(suggest=False)))
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
    """A cause, each as likely as any other, somewhere, of a size that is uniform in its log."""
    ids = sorted({candidate.cause.id for candidate in known})
    name = str(rng.choice(ids))
    locations = [candidate for candidate in known if candidate.cause.id == name]
    candidate = locations[int(rng.integers(len(locations)))]
    size = np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST)))
    # Not all the same: friction as large in both directions has another name.
    way = rng.standard_normal(len(candidate.parameters))
    values = {}
    for p, share in zip(candidate.parameters, way / np.abs(way).max(), strict=True):
        if p.hints.starts:
            values[p.name] = float(rng.choice(p.hints.starts))
        else:
            value = p.null + size * share * p.scale
            values[p.name] = float(value if p.low <= value <= p.high else 2 * p.null - value)
    return candidate, values


def _honest(
    rng: np.random.Generator, known: Sequence[Candidate]
) -> list[tuple[Candidate, dict[str, float]]]:
    """What every drawing is off by, drawn at random."""
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
    """Evidence of the first step's rivals over the null's (k,) [nats], and which were hidden."""
    truth = trial["truth"]
    first = [
        (r, e) for r, e in zip(trial["candidates"], trial["evidence"], strict=True) if r[0] == 0
    ]
    return np.array([e for _, e in first]), np.array([r[1] == truth["cause"] for r, _ in first])


def calibrated(trials: Sequence[Mapping[str, Any]]) -> float:
    """The temper under which what was hidden is likeliest."""
    known = [evidence_and_right(t) for t in trials]

    def loss(x: float) -> float:
        return log_loss(known, float(np.exp(x)))

    ends = tuple(np.log([SHARPEST, DULLEST]))
    return float(np.exp(minimize_scalar(loss, bounds=ends, method="bounded").x))


def log_loss(known: Sequence[tuple[Floats, NDArray[np.bool_]]], temper: float) -> float:
    """Mean of minus the log probability of what was hidden [nats]."""
    chances = [float(tempered(e, temper)[right].sum()) for e, right in known]
    return float(-np.mean(np.log(np.maximum(chances, LEAST))))


def _told(trials: Sequence[Mapping[str, Any]], temper: float) -> tuple[str, str]:
    known = [evidence_and_right(t) for t in trials]
    told = np.array([tempered(e, temper).max() for e, _ in known])
    right = np.array([bool(r[np.argmax(e)]) for e, r in known])
    return f"{log_loss(known, temper):.3f}", f"{expected_error(told, right):.3f}"
