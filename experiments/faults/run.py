"""Faults during learning: detection, effect on the map, and tensions.

A robot learns for some time. Each fault is then injected into a copy of this state for some time,
and the robot continues to learn without it. Only a snapped muscle remains.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.faults.frames import OF_HAND, OF_MARKER
from experiments.faults.injection import FaultyEnv, Injection
from experiments.faults.tables import NO_FAULT, metrics, seed_entry, tables
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.robots.accuracy import MapAccuracy
from experiments.robots.conditions import ACTUAL, Seen, with_seen
from jmm_agent.guard import faults
from jmm_agent.updaters.vision_options import HandKind
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro.agents import make_agent
from kengoro.robots import CAMERA, NO_END, SIDES, make_env, shuffled_postures
from kengoro.session import Session

OUT = Path("out/faults")
"""Folder of the results, if none is given."""
MUSCLE_FAULTS = (
    faults.ENCODER_STUCK,
    faults.ENCODER_JUMP,
    faults.TENSION_SENSOR_DEAD,
    faults.MUSCLE_SNAPPED,
)
ANY_HAND = (faults.CAMERA_FROZEN, *MUSCLE_FAULTS, faults.COMMAND_LATE, faults.PUSHED)
TRIALS: dict[HandKind, tuple[str, ...]] = {
    "marker": (NO_FAULT, *OF_MARKER, *ANY_HAND),
    "seen": (NO_FAULT, *OF_HAND, *ANY_HAND),
}
"""Faults of the trials, and a trial without a fault, by what the hand carries."""
KINDS = tuple(dict.fromkeys(sum(TRIALS.values(), ())))
"""All of them; their order fixes what is random in each."""


@dataclass(frozen=True)
class Sizes:
    """Durations and amount of work on each robot.

    Attributes:
        learning: time of learning before the faults [s].
        fault: time with a fault [s].
        after: time after it [s].
        move: duration of a movement [s].
        patience: longest wait for rest and an observation [s].
        tested: number of postures over which the error of the map is evaluated.
        trials: faults that are injected; none: all that robots with such a hand have.
        hand: whether the hand carries its marker ("marker") or none ("seen").
        detector: digest of the file that sees the hand; empty for Kengoro's own.
    """

    learning: float = 90.0
    fault: float = 10.0
    after: float = 60.0
    move: float = 1.5
    patience: float = 1.0
    tested: int = 50
    trials: tuple[str, ...] = ()
    hand: HandKind = "marker"
    detector: str = ""


@dataclass(frozen=True)
class Args(common.Args):
    """Faults during learning: detection, and effect on the map.

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        learning: time of learning before the faults [s].
        fault: time with each fault [s].
        after: time after it [s].
        hand: whether the hand carries a marker ("marker"), or is seen without one ("seen").
        detector: file of `kengoro hand-detector` that sees the hand; Kengoro's own if left out.
    """

    seeds: str = "0-9"
    out: Path = OUT
    learning: float = 90.0
    fault: float = 10.0
    after: float = 60.0
    hand: HandKind = "marker"
    detector: Path | None = None


QUICK = Sizes(learning=8.0, fault=6.0, after=6.0, tested=10)


class FaultyRun:
    """A robot with faults and its guarded agent, which visit postures.

    Args:
        seed: of the robot.
        cache: folder of trained maps.
        sizes: durations, and whether the hand carries a marker.
        detector: file that sees the hand; None: Kengoro's own.
    """

    def __init__(
        self, seed: int, cache: Path | None, sizes: Sizes, detector: Path | None = None
    ) -> None:
        self._sizes, self._postures, self._visited = sizes, shuffled_postures(seed), 0
        self._detector = MarkerDetector(CAMERA, SIDES) if sizes.hand == "marker" else None
        env = make_env("Posture", seed, hand=sizes.hand, max_episode_steps=NO_END)
        self.env = FaultyEnv(env, self._detector)
        self.agent = make_agent(
            seed, guard=True, detector=self.env.detector, hand=detector or sizes.hand, cache=cache
        )
        start = self._postures[0]
        options = {"posture": start, "target": start}
        self.session = Session(self.env, self.agent, seed, None, options)
        self.named: dict[tuple[str, str], list[float]] = {}
        """Times at which each fault was named [s], by kind and location."""
        self.largest_tension = 0.0
        self.not_finite = 0

    def copy(self) -> FaultyRun:
        """An independent copy that continues from the present state."""
        shared = (self.agent.kinematics, self._detector, self.agent.map, self._postures)
        return deepcopy(self, {id(item): item for item in shared})

    def advance(self, duration: float) -> None:
        """Visit postures for some time [s]."""
        end = self.session.time + duration - 1e-9
        while self.session.time < end:
            self._visited += 1
            self.agent.go(self._postures[self._visited % len(self._postures)], self._sizes.move)
            rest = self.session.time + self._sizes.move - 1e-9
            last = min(rest + self._sizes.patience, end)
            while self.session.time < rest or (self.session.time < last and not self.agent.at_rest):
                self._step()

    def _step(self) -> None:
        self.session.step()
        truth = self.session.truth
        for fault in truth["faults"]:
            times = self.named.setdefault((fault["kind"], fault["where"]), [])
            if fault["since"] not in times:
                times.append(fault["since"])
        tension = float(self.session.log.tensions[-1].max())
        self.largest_tension = max(self.largest_tension, tension)
        for array in (truth["joint_angles"], self.agent.joint_angles):
            self.not_finite += int(np.sum(~np.isfinite(array)))


def injection(kind: str, seed: int, muscles: Sequence[str]) -> Injection | None:
    """Fault of a kind on the robot of a seed, with a random muscle and direction of force."""
    if kind == NO_FAULT:
        return None
    rng = np.random.default_rng([seed, 7, KINDS.index(kind)])
    muscle = str(rng.choice(muscles)) if kind in MUSCLE_FAULTS else ""
    direction = rng.standard_normal(3)
    x, y, z = (direction / np.linalg.norm(direction)).tolist()
    return Injection(kind, muscle, (x, y, z))


def run(
    condition: str, seed: int, sizes: Sizes, cache: Path | None, detector: Path | None = None
) -> dict[str, Any]:
    """Run one robot: learning, then a trial of each fault from that state.

    Args:
        condition: of the robot; there is one.
        seed: of the robot.
        sizes: durations, trials, and whether the hand carries a marker.
        cache: folder of trained maps.
        detector: file that sees the hand; None: Kengoro's own.
    """
    learner = FaultyRun(seed, cache, sizes, detector)
    accuracy, kinds = MapAccuracy(seed, sizes.tested), sizes.trials or TRIALS[sizes.hand]
    learner.advance(sizes.learning)
    trials = {kind: trial(learner.copy(), accuracy, kind, seed, sizes) for kind in kinds}
    learner.env.close()
    return {"learning": record_of(learner, 0.0, sizes.learning), "trials": trials}


def trial(
    faulty: FaultyRun, accuracy: MapAccuracy, kind: str, seed: int, sizes: Sizes
) -> dict[str, Any]:
    """Inject a fault at a random time and remove it after its duration."""
    rng = np.random.default_rng([seed, 9, KINDS.index(kind)])
    faulty.advance(float(rng.uniform(0.0, sizes.move + sizes.patience)))
    faulty.named.clear()
    injected = injection(kind, seed, faulty.env.world.muscles)
    before, begin = accuracy.error_mm(faulty.agent), faulty.session.time
    faulty.env.largest_demand = faulty.largest_tension = 0.0
    faulty.env.inject(injected)
    faulty.advance(sizes.fault)
    gone, shown = faulty.session.time, faulty.env.shown
    if kind != faults.MUSCLE_SNAPPED:
        faulty.env.inject(None)
        faulty.advance(sizes.after)
    faulty.env.close()
    return {
        "kind": kind,
        "where": "" if injected is None else injected.where,
        "begin": begin,
        "shown": shown,
        "gone": gone,
        "before_mm": before,
        "after_mm": accuracy.error_mm(faulty.agent),
        "still_named": [fault.kind for fault in faulty.agent.faults],
        **record_of(faulty, begin, faulty.session.time),
    }


def record_of(faulty: FaultyRun, begin: float, end: float) -> dict[str, Any]:
    """Record of a run from ``begin`` to ``end`` [s]."""
    return {
        "seconds": end - begin,
        "named": [[*what, times] for what, times in faulty.named.items()],
        "largest_demand_N": faulty.env.largest_demand,
        "largest_tension_N": faulty.largest_tension,
        "not_finite": faulty.not_finite,
        "taken_back": faulty.agent.taken_back,
    }


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary.

    Raises:
        ExperimentError: a duration is not positive.
    """
    if min(args.learning, args.fault, args.after) <= 0:
        raise ExperimentError("learning, fault and after must be positive.")
    sizes = replace(EXPERIMENT.sizes, learning=args.learning, fault=args.fault, after=args.after)
    experiment = replace(EXPERIMENT, sizes=sizes)
    return run_experiment(*with_seen(experiment, args, Seen(args.hand, args.detector), OUT))


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Delay of the detection of each fault, and its effects on map and tensions."""
    per_seed = {seed: seed_entry(result[ACTUAL]) for seed, result in results.items()}
    found = tables(per_seed)
    more = {"tables": [table.plain() for table in found[1:]]}
    return Findings(metrics(per_seed), per_seed, found, (), more)


EXPERIMENT = Experiment(
    name="faults",
    title="Faults during learning",
    introduction=(
        "A robot learns. Each fault is then injected for some time, always from the same state, "
        "and the robot continues to learn without it. The agent must name each fault, keep the "
        "map from being changed by it, and never command more tension than the motors may exert."
    ),
    figure="beyond the paper",
    conditions=(ACTUAL,),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)
