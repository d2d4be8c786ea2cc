"""Few observations: how far a robot is from its targets after the first looks at its hand.

A new robot knows its drawing only. Each method drives the same robot to the same postures with its
own commands and learns at each; after some looks its map moves the robot to other postures. One
agent sees nothing: it has lengths and tensions of its rests only. A last part shows how much each
source of information tells of the joint angles.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from experiments.few_observations.chosen import (
    posture_errors,
    posture_metrics,
    posture_tables,
    predicted_observations,
)
from experiments.few_observations.given import known_given, observed_rests
from experiments.few_observations.methods import (
    BLIND,
    BY_SOURCE,
    CHOSEN,
    CONSTANTS,
    COUNTS,
    DRIVING,
    LENGTHS,
    OURS,
    PAPER,
    Sizes,
)
from experiments.few_observations.sources import errors_by_source
from experiments.few_observations.tables import metrics, per_seed, tables
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.robots.conditions import ACTUAL, make_session
from experiments.robots.evaluation import Evaluator, PostureMap, TensionMap
from experiments.robots.variants import PAPER_OPTIONS
from experiments.robots.world import Sizes as BodySizes
from experiments.robots.world import known_world
from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.next_posture import some_of
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions, VisionUpdater
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures
from kengoro.visits import errors, visit

OPTIONS = {
    OURS: AgentOptions(),
    CHOSEN: AgentOptions(),
    LENGTHS: AgentOptions(vision=VisionOptions(fit="together")),
    CONSTANTS: AgentOptions(prior=PriorOptions(shape=1e-6), vision=VisionOptions(fit="together")),
    PAPER: PAPER_OPTIONS,
}
"""Options of each agent. The paper's commands are the map's lengths, in the tests as well."""

QUICK = Sizes(
    counts=(1, 3),
    tested=1,
    blind=5,
    move=0.8,
    patience=1.0,
    test_move=0.4,
    test_hold=0.3,
    initial=100,
)


class Robot:
    """A robot of a seed, on which methods learn and are tested.

    Args:
        seed: of the robot.
        sizes: amount of work.
        cache: folder of trained maps.
    """

    def __init__(self, seed: int, sizes: Sizes, cache: Path | None) -> None:
        self._seed, self._sizes, self._world = seed, sizes, known_world(cache)
        postures = shuffled_postures(seed)
        self.learned, self._tested = postures, postures[-1 - sizes.tested :]
        body = self._world, ACTUAL, seed, sizes.test_move, sizes.test_hold
        self._evaluators = {pulls: Evaluator(*body, pulls) for pulls in (True, False)}

    def tested(
        self, jmm: PostureMap | TensionMap, vision: VisionUpdater, feed_forward: bool = True
    ) -> dict[str, float]:
        """Errors of a map at the test postures; see `kengoro.visits.errors`."""
        return errors(self._evaluators[feed_forward].evaluate(jmm, self._tested, vision))

    def rests(self, jmm: PostureMap | TensionMap) -> Iterator[tuple[Floats, Floats, Floats]]:
        """Angles, lengths and tensions at the test postures; see `Evaluator.rests`."""
        return self._evaluators[True].rests(jmm, self._tested)

    def drive(self, method: str, cache: Path | None) -> dict[str, Any]:
        """Learn by a method; errors by the number of looks, of it and of what it gives others."""
        sizes, seed = self._sizes, self._seed
        rule = MinibatchRule() if method == PAPER else None
        agent = make_agent(seed, options=OPTIONS[method], rule=rule, cache=cache)
        session = make_session(ACTUAL, seed, agent, self.learned[0])
        pulls = agent.options.feed_forward
        before = self.tested(agent.map, deepcopy(agent.vision), pulls)
        found: dict[str, Any] = {method: {"0": before}}
        for number in range(1, 1 + max(sizes.counts)):
            posture = self._next(method, agent, number)
            visit(session, posture, None, sizes.move, sizes.patience)
            if number not in sizes.counts:
                continue
            vision = deepcopy(agent.vision)
            found[method][str(number)] = self.tested(agent.map, vision, pulls)
            if method != OURS:
                continue
            seen = observed_rests(agent.vision, self._world)
            for name, jmm in known_given(cache, sizes.initial).maps(seen).items():
                found.setdefault(name, {})[str(number)] = self.tested(jmm, vision)
        session.env.close()
        found["observations"] = agent.vision.fired
        if method in (OURS, CHOSEN):
            found["predictions"] = predicted_observations(agent.predictions)
            found["dropped"] = agent.vision.dropped
        return found

    def _next(self, method: str, agent: Agent, number: int) -> Floats:
        """Posture of a look: the next one, or the one that the agent chooses among others."""
        if method != CHOSEN:
            return np.asarray(self.learned[number])
        others = self.learned[1 : len(self.learned) - len(self._tested)]
        return agent.next_posture(some_of(others, number)).posture

    def feel(self, cache: Path | None) -> dict[str, Any]:
        """Visit postures without a camera; errors before and after."""
        agent = make_agent(self._seed, options=AgentOptions(camera=""), cache=cache)
        session = make_session(ACTUAL, self._seed, agent, self.learned[0])
        seeing = make_agent(self._seed, cache=cache).vision
        before = self.tested(agent.map, seeing)
        for posture in self.learned[1 : 1 + self._sizes.blind]:
            visit(session, posture, None, self._sizes.move, self._sizes.patience, search=False)
        session.env.close()
        return {"0": before, str(self._sizes.blind): self.tested(agent.map, seeing)}


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Run a method, the agent that sees nothing, or the part on sources, on one robot."""
    if condition == BY_SOURCE:
        return errors_by_source(
            known_world(cache), seed, BodySizes(move=sizes.move, hold=sizes.patience)
        )
    robot = Robot(seed, sizes, cache)
    return robot.feel(cache) if condition == BLIND else robot.drive(condition, cache)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors by number of looks, beside the other methods, and what each source tells."""
    from experiments.few_observations.figures import pictures

    named, shown = posture_metrics(results, sizes), posture_tables(results, sizes)
    if any(PAPER not in result for result in results.values()):
        return Findings(named, posture_errors(results), shown, (), {})
    return Findings(
        metrics(results, sizes) | named,
        per_seed(results),
        tables(results, sizes) + shown,
        pictures(results, sizes),
        {},
    )


EXPERIMENT = Experiment(
    name="few-observations",
    title="Few observations",
    introduction=(
        "A new robot knows its drawing only. Each method drives the same robot to the same "
        "postures with its own commands, its camera and its marker, and learns at each. After some "
        "looks its map moves the robot to other postures, without learning. Further methods, among "
        "them networks of the authors' later papers, get joint angles, tensions and lengths of all "
        "looks of our agent, and start from the same drawing. One agent has no camera."
    ),
    figure="beyond the paper: its second future work",
    conditions=(*DRIVING, BLIND, BY_SOURCE),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
    others=("experiments/baselines",),
)


def with_observations(sizes: Sizes, observations: int) -> Sizes:
    """Sizes with the numbers of looks up to the given one.

    Raises:
        ExperimentError: the number is not positive.
    """
    if observations < 1:
        raise ExperimentError(f"Observations are {observations}, but at least 1 is needed.")
    return replace(sizes, counts=tuple(count for count in COUNTS if count <= observations))


@dataclass(frozen=True)
class Args(common.Args):
    """Errors after the first looks at the hand, and without any.

    Attributes:
        postures: where the hand is observed. "random": at random postures; "both": our agent also
            chooses postures, which is compared; "chosen": this comparison alone.
        observations: most looks on each robot; errors are those after 1, 2, 3, 5, 10, 27 and 81 of
            them, as far as there are so many.
    """

    seeds: str = "0-9"
    out: Path = Path("out/few-observations")
    postures: Literal["random", "chosen", "both"] = "both"
    observations: int = max(Sizes().counts)


CONDITIONS = {
    "random": EXPERIMENT.conditions,
    "both": (*EXPERIMENT.conditions, CHOSEN),
    "chosen": (OURS, CHOSEN),
}
"""Conditions by where the agent looks."""


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    conditions, sizes = CONDITIONS[args.postures], EXPERIMENT.sizes
    sizes = with_observations(sizes, args.observations)
    return run_experiment(replace(EXPERIMENT, conditions=conditions, sizes=sizes), args)
