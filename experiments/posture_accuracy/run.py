"""Antagonism Updater and Vision Updater (paper, sec. IV-D): accuracy of new postures.

Both updaters learn from 27 postures within 300 s. Before and after, with learning off, the robot
moves to 5 new postures from 10 start postures each: 100 trials in total. New postures and starts
are not learned from, and each new posture differs from all learned postures by at least 20 deg in
some joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.posture_accuracy.tables import metrics, seed_entry, tables
from experiments.robots.conditions import ACTUAL, NOMINAL, Seen, make_session, with_seen
from jmm_agent.types import Floats
from jmm_agent.updaters.vision_options import HandKind
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures
from kengoro.session import Session
from kengoro.visits import Visits, no_visits, visit

OUT = Path("out/posture-accuracy")
"""Folder of the results, if none is given."""
AWAY = 20.0
"""Least difference of a new posture from each that was learned [deg], in its largest joint."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures that the robot learns from.
        targets: number of new postures.
        starts: number of start postures of the trials to each new posture.
        starts_nominal: the same, for the robot without departures.
        move: duration of a movement [s].
        patience: longest wait for rest and an observation [s].
        hand: whether the hand carries its marker ("marker") or none ("seen").
        detector: digest of the file that sees the hand; empty for Kengoro's own.
    """

    learned: int = 27
    targets: int = 5
    starts: int = 10
    starts_nominal: int = 2
    move: float = 2.0
    patience: float = 2.5
    hand: HandKind = "marker"
    detector: str = ""


QUICK = Sizes(learned=3, targets=1, starts=2, starts_nominal=1, move=1.0, patience=1.5)


class Plan(NamedTuple):
    """Postures of a robot, one in each row [rad].

    Attributes:
        first: initial posture.
        learned: postures to learn from.
        targets, starts: new postures, and start postures of the trials.
    """

    first: Floats
    learned: Floats
    targets: Floats
    starts: Floats


def make_plan(seed: int, sizes: Sizes) -> Plan:
    """Choose postures in random order, with targets at least `AWAY` from all learned postures.

    Raises:
        ExperimentError: too few postures of the set are that far away.
    """
    postures = shuffled_postures(seed)
    first, learned, rest = np.split(postures, [1, 1 + sizes.learned])
    starts, rest = np.split(rest, [sizes.starts])
    far = rest[away(rest, learned)[0] >= AWAY]
    if len(far) < sizes.targets:
        raise ExperimentError(
            f"Only {len(far)} postures are {AWAY:g} deg away from {sizes.learned} learned ones, "
            f"{sizes.targets} are needed."
        )
    return Plan(first[0], learned, far[: sizes.targets], starts)


def away(postures: Floats, learned: Floats) -> tuple[Floats, Floats]:
    """Distance of postures from the nearest learned posture.

    Args:
        postures: joint angles, shape (K, n) [rad].
        learned: joint angles, shape (L, n) [rad].

    Returns:
        Distance by the largest joint difference, and by the RMS over joints, shape (K,) each [deg].
    """
    gaps = np.degrees(np.abs(postures[:, None] - learned[None]))
    return gaps.max(axis=2).min(axis=1), np.sqrt((gaps**2).mean(axis=2)).min(axis=1)


def run(
    condition: str, seed: int, sizes: Sizes, cache: Path | None, detector: Path | None = None
) -> dict[str, Any]:
    """Run one robot: trials, online learning with both updaters, and the same trials again.

    Args:
        condition: `ACTUAL` or `NOMINAL`.
        seed: of the robot.
        sizes: amount of work.
        cache: folder of trained maps.
        detector: file that sees the hand; None: Kengoro's own.
    """
    plan = make_plan(seed, sizes)
    starts = plan.starts if condition == ACTUAL else plan.starts[: sizes.starts_nominal]
    agent = make_agent(seed, cache=cache, hand=detector or sizes.hand)
    session = make_session(condition, seed, agent, plan.first, sizes.hand)
    agent.learning = False
    before = trials(session, plan.targets, starts, sizes)
    agent.learning = True
    begin = session.time
    lesson = no_visits()
    for posture in plan.learned:
        visit(session, posture, lesson, sizes.move, sizes.patience)
    learning_time = session.time - begin
    agent.learning = False
    after = trials(session, plan.targets, starts, sizes)
    session.env.close()
    largest, rms = away(plan.targets, plan.learned)
    return {
        "before": before,
        "after": after,
        "starts": len(starts),
        "learning_time": round(learning_time, 2),
        "away_deg": np.round(largest, 2).tolist(),
        "away_rms_deg": np.round(rms, 2).tolist(),
        "updates": {"antagonism": agent.antagonism.fired, "vision": agent.vision.fired},
        "dropped": agent.vision.dropped,
    }


def trials(session: Session, targets: Floats, starts: Floats, sizes: Sizes) -> Visits:
    """Visit each target, shape (K, n) [rad], from each start, shape (S, n) [rad].

    Returns:
        K S visits, ordered by target.
    """
    visits = no_visits()
    for target in targets:
        for start in starts:
            session.move(start, sizes.move, sizes.patience)
            visit(session, target, visits, sizes.move, sizes.patience)
    return visits


def conclude(results: Results, sizes: Sizes) -> Findings:
    """RMSE_joint and Distance_hand before and after, by both definitions."""
    from experiments.posture_accuracy.figures import pictures

    per_seed = {
        seed: {condition: seed_entry(result[condition]) for condition in (ACTUAL, NOMINAL)}
        for seed, result in results.items()
    }
    return Findings(metrics(per_seed), per_seed, tables(per_seed), pictures(results), {})


EXPERIMENT = Experiment(
    name="posture-accuracy",
    title="Antagonism Updater and Vision Updater together",
    introduction=(
        "The robot moves to new postures from random start postures, before and after online "
        "learning with both updaters from other postures; learning is off in these trials. The "
        "same is done on robots without departures, which show the sag under gravity with an exact "
        "map."
    ),
    figure="Fig. 11",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Both updaters, tested on new postures (Fig. 11).

    Attributes:
        hand: whether the hand carries a marker ("marker"), or is seen without one ("seen").
        detector: file of `kengoro hand-detector` that sees the hand; Kengoro's own if left out.
    """

    seeds: str = "0-9"
    out: Path = OUT
    hand: HandKind = "marker"
    detector: Path | None = None


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(*with_seen(EXPERIMENT, args, Seen(args.hand, args.detector), OUT))
