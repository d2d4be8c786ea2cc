"""A muscle snaps in motion: it is named and left out, and the robot moves on with the others.

A robot learns as usual. Then a muscle snaps while the robot moves: one that some postures need, and
others, each on a copy of the agent. Errors are measured with learning off before it snaps, right
after, and after ten more postures with the camera. The same robot with an agent that does not
notice is measured, too. Postures that the remaining muscles cannot hold by the balance of tensions
and gravity are counted for themselves, and the joint that the agent names is compared with the one
that lacks most torque on the actual robot.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.posture_accuracy.run import Sizes as PlanSizes
from experiments.posture_accuracy.run import make_plan
from experiments.robots.conditions import ACTUAL, make_session
from experiments.robots.robot_arms import RobotArms
from experiments.wire_snaps.balance import Arms, Balances
from experiments.wire_snaps.tables import metrics, per_seed, tables
from jmm_agent.agent import Agent
from jmm_agent.guard.faults import MUSCLE_SNAPPED, POSTURE_NOT_HELD
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.robots import NO_END, make_env, shuffled_postures
from kengoro.session import Session
from kengoro.visits import visit

SNAPPED = 1e3
"""Elongation of a snapped muscle, which its motor never winds up [m]."""
CRITICAL = 0.05
"""Share of postures that cannot be held without a critical muscle, from which on it is one [1]."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures that it learns from.
        muscles: number of muscles that snap, each on a copy; the first one is critical.
        tested: number of postures at which errors are measured.
        later: number of postures after the snap, with the camera.
        judged: number of postures for which it is asked whether they can be held.
        move: duration of a movement [s].
        patience: longest wait for rest and an observation [s].
    """

    learned: int = 27
    muscles: int = 2
    tested: int = 6
    later: int = 10
    judged: int = 60
    move: float = 2.0
    patience: float = 2.5


QUICK = Sizes(learned=2, muscles=1, tested=2, later=1, judged=10, move=1.0, patience=1.5)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Let a robot learn; then let muscles snap, each on a copy."""
    count = 2 + sizes.tested + sizes.later
    plan = make_plan(seed, PlanSizes(learned=sizes.learned, targets=1, starts=count))
    agent = make_agent(seed, guard=True, cache=cache)
    assert agent.motors is not None
    session = make_session(ACTUAL, seed, agent, plan.first)
    false: set[str] = set()
    for posture in plan.learned:
        visit(session, posture, None, sizes.move, sizes.patience)
        false |= {fault.where for fault in agent.faults if fault.kind == MUSCLE_SNAPPED}
    session.env.close()
    balances = Balances(agent.motors, agent.kinematics.limits)
    arms = RobotArms(session.world.robot)
    judged = shuffled_postures(seed)[-sizes.judged :]
    tested, more = plan.starts[: 1 + sizes.tested], plan.starts[1 + sizes.tested :]
    found: dict[str, Any] = {
        "false": sorted(false),
        "before": visits(agent, seed, tested, "", sizes, balances, arms),
        "muscles": [],
    }
    for muscle in chosen_muscles(agent, seed, balances, judged, sizes.muscles):
        unnoticed = deepcopy(agent)
        unnoticed.guard, unnoticed.wiring.watching = NullGuard(), False
        blind = visits(unnoticed, seed, tested, muscle, sizes, balances, arms)
        without = deepcopy(agent)
        entry: dict[str, Any] = {"muscle": muscle, "unnoticed": blind}
        entry["lost"] = balances.lost(agent.map, muscle, judged)
        entry["lost_actual"] = balances.lost(arms, muscle, judged)
        demand = Demand()
        session = snap(without, seed, more[:2], muscle, sizes, entry, demand)
        entry["after"] = visits(deepcopy(without), seed, tested, muscle, sizes, balances, arms)
        before = without.vision.fired
        for posture in more[1:]:
            visit(session, posture, None, sizes.move, sizes.patience)
        entry["observations"] = without.vision.fired - before
        entry["largest_N"] = float(np.max(session.log.tensions))
        entry["demanded_N"] = demand.largest
        session.env.close()
        entry["learned"] = visits(without, seed, tested, muscle, sizes, balances, arms)
        found["muscles"].append(entry)
    return found


class Demand:
    """Watches the tensions that commands demand at the lengths that were measured.

    Attributes:
        largest: so far [N].
    """

    def __init__(self) -> None:
        self.largest, self._lengths = 0.0, np.empty(0)

    def __call__(self, session: Session) -> None:
        """Add the newest command."""
        motors, lengths = session.agent.motors, self._lengths
        assert motors is not None
        if lengths.size:
            demanded = motors.demanded(lengths, session.world.robot.target)
            self.largest = max(self.largest, float(demanded.max()))
        self._lengths = session.readings.lengths.copy()


def chosen_muscles(
    agent: Agent, seed: int, balances: Balances, postures: Floats, count: int
) -> list[str]:
    """Names of muscles in random order, first one that some postures need and then others."""
    lost = {muscle: balances.lost(agent.map, muscle, postures) for muscle in agent.map.muscles}
    rng = np.random.default_rng([seed, 37])
    order = [str(muscle) for muscle in rng.permutation(agent.map.muscles)]
    critical = [muscle for muscle in order if lost[muscle] >= CRITICAL]
    return [*critical[:1], *(muscle for muscle in order if muscle not in critical[:1])][:count]


def snap(
    agent: Agent,
    seed: int,
    postures: Floats,
    muscle: str,
    sizes: Sizes,
    entry: dict[str, Any],
    demand: Demand,
) -> Session:
    """Let a muscle snap in the middle of a movement; when it is named goes to ``entry``."""
    env = make_env("Posture", seed, max_episode_steps=NO_END)
    start = {"posture": postures[0], "target": postures[0]}
    session = Session(env, agent, seed, demand, start)
    session.wait(sizes.patience)
    agent.go(postures[1], sizes.move)
    session.wait(sizes.move / 2)
    begin, named, left = session.time, None, None
    session.world.robot.elongate(muscle, SNAPPED)
    for _ in range(round((sizes.move / 2 + sizes.patience) / session.world.robot.control_period)):
        session.step()
        snapped = {fault.where for fault in agent.faults if fault.kind == MUSCLE_SNAPPED}
        named = session.time - begin if named is None and muscle in snapped else named
        left = session.time - begin if left is None and agent.in_use.left_out else left
    others = {fault.where for fault in agent.faults if fault.kind == MUSCLE_SNAPPED} - {muscle}
    entry |= {"named_s": named, "left_out_s": left, "others": sorted(others)}
    return session


def visits(
    agent: Agent,
    seed: int,
    postures: Floats,
    muscle: str,
    sizes: Sizes,
    balances: Balances,
    arms: Arms,
) -> list[dict[str, Any]]:
    """Move to postures without learning, with or without a muscle.

    Args:
        agent: moves the robot.
        seed: of the robot.
        postures: where it starts and where it goes (1 + K, n) [rad].
        muscle: that has snapped; empty if none has.
        sizes: durations.
        balances: which postures can be held.
        arms: of the actual robot.

    Returns:
        For each posture: |wanted - true| and |target - true| [deg] (RMS over joints), whether the
        agent's map says that it can be held, the joints that lack torque by the agent and on the
        actual robot, and the largest tension, and demand of the commands so far [N].
    """
    env = make_env("Posture", seed, max_episode_steps=NO_END, camera=False)
    start, demand = {"posture": postures[0], "target": postures[0]}, Demand()
    session = Session(env, agent, seed, demand, start)
    if muscle:
        session.world.robot.elongate(muscle, SNAPPED)
    learning, agent.learning = agent.learning, False
    agent.go(postures[0], 0.0)
    session.wait(sizes.patience)
    found = []
    for posture in postures[1:]:
        begin = len(session.log.tensions)
        session.move(posture, sizes.move, sizes.patience)
        true, joints = session.truth["joint_angles"], agent.map.joints
        fault = next((one for one in agent.faults if one.kind == POSTURE_NOT_HELD), None)
        lacks = balances.lacking(arms, muscle, posture)
        found.append(
            {
                "wanted_deg": _rms_deg(posture - true),
                "target_deg": _rms_deg(agent.target - true),
                "held": balances.lacking(agent.map, muscle, posture) is None,
                "named": None if fault is None else fault.where,
                "lacks": None if lacks is None else joints[lacks],
                "largest_N": float(np.max(session.log.tensions[begin:])),
                "demanded_N": demand.largest,
            }
        )
    env.close()
    agent.learning = learning
    return found


def _rms_deg(angles: Floats) -> float:
    return round(float(np.degrees(np.sqrt(np.mean(np.square(angles))))), 4)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors with and without the muscles, and what was named."""
    from experiments.wire_snaps.figures import pictures

    return Findings(metrics(results), per_seed(results), tables(results), pictures(results), {})


EXPERIMENT = Experiment(
    name="wire-snaps",
    title="A muscle snaps",
    introduction=(
        "Actual robots learn. Then a muscle snaps while the robot moves: one that some postures "
        "need, and others, each on a copy. Errors are those of postures that were not learned "
        "from, without learning, on the actual robot."
    ),
    figure="beyond the paper: arXiv 2409.14951 of the same authors",
    conditions=(ACTUAL,),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
    others=("experiments/posture_accuracy",),
)


@dataclass(frozen=True)
class Args(common.Args):
    """Snapped muscles: named, left out, and the errors of the robot that moves on."""

    seeds: str = "0-9"
    out: Path = Path("out/wire-snaps")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)
