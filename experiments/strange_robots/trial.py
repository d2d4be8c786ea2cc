"""One strange robot: an agent learns on it, and its errors are measured after some looks."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from experiments.stiffness_and_load.load import carried
from experiments.strange_robots.families import DRIFT, FAMILIES, PRESET, SOFT, make_robot
from jmm_agent.agent import Agent
from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.commissioning import commission
from kengoro.errors import UsageError
from kengoro.robots import shuffled_postures
from kengoro.session import Session
from kengoro.visits import grip, visit

LONG = (PRESET, DRIFT)
"""Families that are learned for `Sizes.long` looks."""
POSTURE = 0.1
"""Standard deviation of the posture that a commissioning run is given from the true one, as a share
of the ranges of the joints [1]."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        counts: numbers of looks after which the agent is tested.
        long: number of looks of the robots that drift, and of those that they are compared with.
        tested: number of other postures in a test.
        loads: masses that are put into the hand of soft robots; 0 for none [kg].
        known: number of postures with a load before the test.
        move: duration of a movement while learning [s].
        patience: longest wait for rest and an observation while learning [s].
        test_move: duration of a movement in a test [s].
        test_hold: time to come to rest in a test [s].
    """

    counts: tuple[int, ...] = (1, 5, 27)
    long: int = 200
    tested: int = 10
    loads: tuple[float, ...] = (0.0, 0.5, 1.0)
    known: int = 3
    move: float = 1.5
    patience: float = 2.0
    test_move: float = 1.5
    test_hold: float = 1.2

    def counts_of(self, family: str) -> tuple[int, ...]:
        """Numbers of looks after which the agent of a family is tested."""
        return (*self.counts, self.long) if family in LONG else self.counts


@dataclass
class Named:
    """What an agent says is wrong while it learns.

    Attributes:
        observations: number of looks so far.
        faults: kind, place, detail, and number of looks, of each fault when it was found first.
        warnings: sentences of the agent's log, with the number of looks.
    """

    observations: int = 0
    faults: dict[tuple[str, str], tuple[str, int]] = field(default_factory=dict)
    warnings: dict[str, int] = field(default_factory=dict)

    def watch(self, session: Session) -> None:
        """Note the faults that are found now."""
        for fault in session.agent.faults:
            self.faults.setdefault((fault.kind, fault.where), (fault.detail, self.observations))

    def first(self, muscles: tuple[str, ...]) -> int | None:
        """Number of looks after which all of some muscles had been named; None if never.

        A muscle is named by a fault at it, or by a fault's or a warning's sentence.
        """
        texts = [(f"{where} {detail}", at) for (_, where), (detail, at) in self.faults.items()]
        texts += list(self.warnings.items())
        after = [
            min((at for text, at in texts if muscle in _words(text)), default=None)
            for muscle in muscles
        ]
        found = [at for at in after if at is not None]
        return max(found) if found and len(found) == len(after) else None

    def wrong(self, odd: tuple[str, ...], muscles: tuple[str, ...]) -> list[str]:
        """Faults at other muscles: kind and place, which may be two muscles that are exchanged."""
        others = set(muscles) - set(odd)
        return [f"{kind} {where}" for kind, where in self.faults if others & _words(where)]

    def plain(self) -> list[list[Any]]:
        """All faults for JSON: kind, place, number of looks, detail."""
        return [[kind, where, at, detail] for (kind, where), (detail, at) in self.faults.items()]


def _words(text: str) -> set[str]:
    """Words of a sentence, without punctuation."""
    return {word.strip(".,:;()'\"") for word in text.split()}


@contextmanager
def warnings_of_agent(named: Named) -> Iterator[None]:
    """Within this context warnings in the log of an agent are noted."""

    class Noting(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            named.warnings.setdefault(record.getMessage(), named.observations)

    handler, logger = Noting(logging.WARNING), logging.getLogger("jmm_agent")
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


def learn(family: str, seed: int, sizes: Sizes, cache: Path | None, run: bool) -> dict[str, Any]:
    """Learn on a robot; errors by the number of looks, and what the agent named.

    Args:
        family: one of `FAMILIES`.
        seed: of the robot.
        sizes: amount of work.
        cache: folder of trained maps.
        run: whether a commissioning run comes first, and the agent gets its result.
    """
    postures = shuffled_postures(seed)
    learned, tested = postures[:-20], postures[-1 - sizes.tested :]
    result: dict[str, Any] = {}
    agent = make_agent(seed, cache=cache)
    if run:
        agent, result["commissioning"] = commissioned(agent, family, seed, learned[0], cache)
    test = Test(family, seed, tested, sizes)
    result["errors"] = {"0": test.errors(agent, 0.0)}
    env, named = make_robot(family, seed), Named()
    odd = FAMILIES[family].odd(seed, muscles := env.unwrapped.muscles)  # type: ignore[attr-defined]
    start = {"posture": learned[0], "target": learned[0]}
    with warnings_of_agent(named):
        session = Session(env, agent, seed, named.watch, start)
        counts = sizes.counts_of(family)
        for number in range(1, 1 + max(counts)):
            named.observations = number
            visit(session, learned[number], None, sizes.move, sizes.patience)
            if number in counts:
                result["errors"][str(number)] = test.errors(agent, session.time)
    pulled = float(np.max(session.log.tensions))
    env.close()
    if family == SOFT:
        result["loads"] = _loads(agent, seed, sizes)
    events = agent.vision.elongated[:1].sum()
    return result | {
        "learned": agent.vision.fired,
        "dropped": agent.vision.dropped,
        "events": int(events),
        "tension_N": round(pulled, 1),
        "duration_s": round(session.time, 1),
        "odd": list(odd),
        "named_after": named.first(odd) if odd else None,
        "false_names": named.wrong(odd, muscles),
        "faults": named.plain(),
    }


@dataclass(frozen=True)
class Test:
    """Test of an agent on its robot, at postures that it does not learn from.

    Attributes:
        family: of the robot.
        seed: of the robot.
        postures: joint angles (1 + K, n) [rad], where it starts and where it goes.
        sizes: durations.
    """

    family: str
    seed: int
    postures: Floats
    sizes: Sizes

    def errors(self, agent: Agent, elapsed: float) -> dict[str, float]:
        """Errors target - true of a copy of the agent, which does not learn.

        Args:
            agent: has learned.
            elapsed: time for which the robot has run [s].

        Returns:
            Medians over postures: RMS over joints [deg], distance of the hand from where it is at
            the target by the drawing [mm]; and the largest tension [N].
        """
        agent = deepcopy(agent)
        agent.learning = False
        env = make_robot(self.family, self.seed, camera=False, elapsed=elapsed, stays=True)
        start, *targets = self.postures
        session = Session(env, agent, self.seed, None, {"posture": start, "target": start})
        joints, hands = [], []
        for target in targets:
            session.move(target, self.sizes.test_move)
            session.wait(self.sizes.test_hold)
            truth = session.truth
            missed = target - truth["joint_angles"]
            joints.append(float(np.degrees(np.sqrt(np.mean(np.square(missed))))))
            hands.append(1e3 * float(np.linalg.norm(truth["hand_pose"][:3, 3] - grip(target))))
        env.close()
        return {
            "target_true_deg": round(float(np.median(joints)), 4),
            "target_true_mm": round(float(np.median(hands)), 3),
            "max_tension_N": round(float(np.max(session.log.tensions)), 1),
        }


def commissioned(
    agent: Agent, family: str, seed: int, start: Floats, cache: Path | None
) -> tuple[Agent, dict[str, Any]]:
    """An agent that has the result of a commissioning run, and what the run found.

    An agent that cannot use the result stays as it is.
    """
    low, high = agent.kinematics.limits.T
    rng = np.random.default_rng([seed, 37])
    given = start + POSTURE * (high - low) * rng.standard_normal(len(start))
    env = make_robot(family, seed, camera=False)
    session = Session(env, agent, seed, None, {"posture": start, "target": start})
    found = commission(session, given)
    env.close()
    plain: dict[str, Any] = {
        "found": [[one.kind, *one.muscles] for one in found.findings],
        "undecided": [[one.kind, *one.muscles] for one in found.undecided],
        "seconds": round(found.seconds, 1),
        "refused": "",
    }
    try:
        return make_agent(seed, cache=cache, commissioning=found), plain
    except (AgentError, UsageError) as error:
        return make_agent(seed, cache=cache), plain | {"refused": str(error)}


def _loads(agent: Agent, seed: int, sizes: Sizes) -> dict[str, Any]:
    """`carried` by mass [kg]."""
    postures, departures = shuffled_postures(seed), FAMILIES[SOFT].departures(seed)
    postures = postures[-1 - sizes.known - sizes.tested :]
    agent = deepcopy(agent)
    agent.learning = False
    times = sizes.test_move, sizes.test_hold, sizes.known
    return {
        f"{mass:g}": carried(agent, seed, postures, mass, *times, departures)
        for mass in sizes.loads
    }
