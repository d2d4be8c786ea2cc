"""Chooses the settings of the learners of `successors` on tuning robots, from one grid for all.

    python -m experiments.few_observations.tune --seeds 20-22

Each robot is driven by our agent, whose looks are given to each learner with each setting. Its map
then estimates joint angles from lengths and tensions of the robot at other postures: the score is
the RMSE_joint of these estimates, median over postures, geometric mean over robots and numbers of
looks. The settings with the lowest score are those in `successors.SETTINGS`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import tyro
from rich.console import Console

from experiments.few_observations.given import observed_rests
from experiments.few_observations.methods import AUTOENCODER, OURS, PHYSICS, ROUTE_CHANGE, Sizes
from experiments.few_observations.run import OPTIONS, Robot
from experiments.few_observations.successor_data import Initial, Learning, Observed
from experiments.few_observations.successors import Successors, nominal_rests
from experiments.harness.common import parse_seeds
from experiments.harness.errors import ExperimentError
from experiments.robots.conditions import ACTUAL, make_session
from experiments.robots.evaluation import TensionMap
from experiments.robots.world import World, known_world
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.visits import visit

RATES = (1e-4, 1e-3)
"""Step sizes of Adam."""
STEPS = (30, 100, 300)
"""Numbers of its steps."""
OWN = {
    ROUTE_CHANGE: ((0.0, 0.0), (0.01, 0.0), (0.1, 0.0)),
    AUTOENCODER: ((0.0, 0.0), (0.01, 0.0), (0.1, 0.0)),
    PHYSICS: ((0.01, 0.0), (0.1, 0.0), (0.1, 0.01)),
}
"""Pairs of `Learning.own` and `Learning.boundary`."""
LAST = 100
"""First seed of the reporting robots."""


class Tested(NamedTuple):
    """A robot at postures that were not learned from.

    Attributes:
        angles: true joint angles (K, n) [rad].
        lengths: measured (K, m) [m].
        tensions: measured (K, m) [N].
    """

    angles: Floats
    lengths: Floats
    tensions: Floats


class Case(NamedTuple):
    """Looks of a robot, and the robot at other postures."""

    seen: Observed
    tested: Tested


def cases(seed: int, counts: Sequence[int], folder: Path | None) -> list[Case]:
    """Looks of our agent on a robot after some postures.

    Args:
        seed: of the robot.
        counts: numbers of postures, rising.
        folder: of trained maps; the user's cache folder if left out.
    """
    sizes, world = Sizes(), known_world(folder)
    robot = Robot(seed, sizes, folder)
    agent = make_agent(seed, options=OPTIONS[OURS], cache=folder)
    session = make_session(ACTUAL, seed, agent, robot.learned[0])
    found = []
    for number, posture in enumerate(robot.learned[1 : 1 + counts[-1]], start=1):
        visit(session, posture, None, sizes.move, sizes.patience)
        if number in counts:
            found.append(observed_rests(agent.vision, world))
    session.env.close()
    tested = Tested(*(np.array(part) for part in zip(*robot.rests(agent.map), strict=True)))
    return [Case(seen, tested) for seen in found]


def score(jmm: TensionMap, tested: Tested, world: World) -> float:
    """RMSE_joint of a map's estimates, median over postures [deg]."""
    errors = [
        world.estimate(jmm.at(tensions), lengths, true) - true
        for true, lengths, tensions in zip(*tested, strict=True)
    ]
    return float(np.degrees(np.median(np.sqrt(np.mean(np.square(errors), axis=1)))))


def tried(
    name: str, successors: Successors, known: Sequence[Case], world: World
) -> Iterator[tuple[Learning, Floats]]:
    """Settings of a learner, and their scores in all cases [deg]."""
    for rate, (own, boundary) in product(RATES, OWN[name]):
        learning = Learning(rate, STEPS, own, boundary)
        scores = [
            [score(jmm, case.tested, world) for jmm in successors.learn(name, case.seen, learning)]
            for case in known
        ]
        for steps, column in zip(STEPS, np.transpose(scores), strict=True):
            yield replace(learning, steps=(steps,)), column


@dataclass(frozen=True)
class Args:
    """Options.

    Attributes:
        seeds: seeds of the tuning robots, below 100.
        counts: numbers of looks, rising.
        cache: folder of trained maps; the user's cache folder if left out.
    """

    seeds: str = "20-22"
    counts: tuple[int, ...] = (3, 10)
    cache: Path | None = None


def main(args: Args) -> None:
    """Print the scores of all settings, the best of each learner last.

    Raises:
        ExperimentError: an option is invalid.
    """
    seeds, counts = parse_seeds(args.seeds), list(args.counts)
    if not counts or counts[0] < 1 or counts != sorted(set(counts)):
        raise ExperimentError(f"Counts are {counts}; give numbers of looks from 1 on, rising.")
    if max(seeds) >= LAST:
        raise ExperimentError(f"Seeds are {args.seeds}; tuning robots have seeds below {LAST}.")
    world, out = known_world(args.cache), Console()
    successors = Successors(world, Initial(), args.cache)
    typical = nominal_rests(world, world.postures[-200:])
    nominal = successors.map(AUTOENCODER, typical.first(0))
    missed = nominal.lengths(typical.angles, typical.tensions) - typical.lengths
    error = 1e3 * np.sqrt(np.mean(missed**2))
    out.print(f"{AUTOENCODER}: lengths of the drawing to {error:.2f} mm (RMS)", highlight=False)
    known = [case for seed in seeds for case in cases(seed, args.counts, args.cache)]
    for name in OWN:
        best = np.inf
        for learning, scores in tried(name, successors, known, world):
            mean = float(np.exp(np.mean(np.log(scores))))
            columns = scores.reshape(len(seeds), -1)
            by_count = " ".join(f"{value:.2f}" for value in np.median(columns, axis=0))
            mark, best = (" *", mean) if mean < best else ("", best)
            out.print(
                f"{name}: rate {learning.rate:g}, {learning.steps[0]} steps, own {learning.own:g}, "
                f"boundary {learning.boundary:g}: {mean:.3f} deg ({by_count}){mark}",
                highlight=False,
                soft_wrap=True,
            )


if __name__ == "__main__":
    try:
        main(tyro.cli(Args))
    except ExperimentError as error:
        sys.exit(str(error))
