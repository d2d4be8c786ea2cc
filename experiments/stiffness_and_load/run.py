"""Stiffness: postures that soft muscles hold, and the stiffness of joints that a push shows.

A robot learns at the stiffness that its motors were made with. Then the stiffness is set, with
learning off, and the robot moves to postures that it did not learn from. Three agents do so: one
whose commands are the map's lengths, ours, whose commands pull with distributed tensions, and ours
when it was told how its tendons stretch, as a bench shows. Both of ours are asked for the stiffness
of joints, and a torque on the joint shows how stiff it is. Ours also gets loads into its hand, and
does two things against what friction leaves of a movement: it comes to each posture from the same
side, or its commands go on until the estimated posture is the target.

A push begins with a smaller torque, so that dry friction, which resists as much at both, does not
count. Friction of F leaves the tendon of a muscle anywhere within F / K.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.posture_accuracy.run import Sizes as PlanSizes
from experiments.posture_accuracy.run import make_plan
from experiments.robots.conditions import ACTUAL, make_session
from experiments.stiffness_and_load.load import carried
from experiments.stiffness_and_load.tables import (
    AGENTS,
    FEEDBACK,
    OURS,
    SAG,
    SIDE,
    TENDONS,
    friction_metrics,
    friction_table,
    load_metrics,
    load_table,
    metrics,
    per_seed,
    tables,
)
from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.mapping.tendon_stretch import TendonStretch
from jmm_agent.posture_feedback import FeedbackOptions
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.robots import NO_END, make_env
from kengoro.session import Session
from kengoro.trained_maps import trained_map
from kengoro.visits import errors, no_visits, rmse_deg, visit

COMPLIANCE, HARDENING = 1e-5, 4e6
"""Of the tendons of actual robots, as a bench shows them [m/N], [N/m^2]."""
ASIDE, SHORT = 0.15, 0.5
"""By how much joints are lower before each posture that is approached from one side [rad], and
duration of that approach, as a share of a movement's [1]."""
MOST_ASKED = 60_000.0
"""Highest stiffness of a muscle that joints may get [N/m]."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures that it learns from.
        tested: number of postures that it then moves to at each stiffness.
        stiffness: of the muscles, the one of learning first [N/mm].
        joints: joints that are pushed.
        shares: stiffness that they are asked for, as shares of that at the stiffness of learning.
        bend: angle by which a push should bend a joint [deg].
        loads: masses that are put into the hand; 0 for none [kg].
        known: number of postures with a load after which its mass is to be known.
        move: duration of a movement [s].
        patience: longest wait for rest and an observation [s].
        settle: time in which a push, and a change of stiffness, comes to rest [s].
    """

    learned: int = 27
    tested: int = 10
    stiffness: tuple[float, ...] = (30.0, 10.0, 3.0)
    joints: tuple[str, ...] = ("sh_pitch", "sh_roll", "elbow")
    shares: tuple[float, ...] = (0.3, 0.6)
    bend: float = 2.0
    loads: tuple[float, ...] = (0.0, 0.5, 1.0)
    known: int = 3
    move: float = 2.0
    patience: float = 2.5
    settle: float = 2.0


QUICK = Sizes(
    learned=1, tested=1, stiffness=(30.0, 10.0), joints=("elbow",), shares=(0.4,),
    loads=(0.0, 1.0), known=1, move=0.8, patience=1.2, settle=0.8,
)  # fmt: skip


def agent_of(condition: str, seed: int, cache: Path | None) -> Agent:
    """Agent of a condition."""
    jmm = trained_map(cache)
    if condition == TENDONS:
        ones = np.ones(len(jmm.muscles))
        bias = make_agent(seed, jmm=jmm).motors
        assert bias is not None
        tendons = TendonStretch(COMPLIANCE * ones, HARDENING * ones, bias.bias * ones)
        jmm = replace(jmm, tendons=tendons)
    return make_agent(seed, jmm=jmm, options=AgentOptions(feed_forward=condition != SAG))


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Let an agent learn on a robot; then errors at each stiffness, and pushes."""
    plan = make_plan(seed, PlanSizes(learned=sizes.learned, targets=1, starts=1))
    agent = agent_of(condition, seed, cache)
    session = make_session(ACTUAL, seed, agent, plan.first)
    for posture in plan.learned:
        visit(session, posture, None, sizes.move, sizes.patience)
    session.env.close()
    agent.learning = False
    tested = _tested(seed, sizes)
    found: dict[str, Any] = {"observations": agent.vision.fired, "at": {}, "pushes": []}
    if condition == OURS:
        postures, times = _carried(seed, sizes), (sizes.move, sizes.settle, sizes.known)
        found["loads"] = {
            f"{mass:g}": carried(agent, seed, postures, mass, *times) for mass in sizes.loads
        }
    for stiffness in sizes.stiffness:
        found["at"][f"{stiffness:g}"] = _visited(agent, seed, tested, stiffness, sizes)
    if condition == OURS:
        found |= _against_friction(agent, seed, tested, sizes)
    if condition != SAG:
        session = _without_camera(agent, seed, tested[0])
        found["pushes"] = pushes(session, tested[1], sizes)
        session.env.close()
    return found


def _visited(
    agent: Agent, seed: int, tested: Floats, stiffness: float, sizes: Sizes, aside: float = 0.0
) -> dict[str, float]:
    """Errors of an agent that learns no more, at postures (1 + K, n) [rad] and a stiffness [N/mm].

    With ``aside`` it comes to each from a posture whose joints are lower by so much [rad].
    """
    session = _without_camera(agent, seed, tested[0])
    agent.set_stiffness(1e3 * stiffness)
    session.wait(sizes.settle)
    visits = no_visits()
    for posture in tested[1:]:
        move = sizes.move
        if aside:
            session.move(posture - aside, sizes.move)
            move = SHORT * sizes.move
        visit(session, posture, visits, move, sizes.settle, search=False)
    session.env.close()
    return errors(visits) | {"worst_deg": float(rmse_deg(visits, "target_true").max())}


def _against_friction(agent: Agent, seed: int, tested: Floats, sizes: Sizes) -> dict[str, Any]:
    """Errors by stiffness, of postures that are approached from one side, and with feedback."""
    found: dict[str, Any] = {SIDE: {}, FEEDBACK: {}}
    for stiffness in sizes.stiffness:
        key = f"{stiffness:g}"
        found[SIDE][key] = _visited(agent, seed, tested, stiffness, sizes, ASIDE)
        agent.feedback = FeedbackOptions()
        found[FEEDBACK][key] = _visited(agent, seed, tested, stiffness, sizes)
        agent.feedback = None
    return found


def _tested(seed: int, sizes: Sizes) -> Floats:
    """A posture to start at, and others that are not learned from, shape (1 + tested, n) [rad]."""
    plan = make_plan(seed, PlanSizes(learned=sizes.learned, targets=1, starts=1 + sizes.tested))
    return plan.starts


def _carried(seed: int, sizes: Sizes) -> Floats:
    """A posture to start at, and those to which loads are moved, shape (1 + K, n) [rad]."""
    count = 1 + sizes.known + sizes.tested
    return make_plan(seed, PlanSizes(learned=sizes.learned, targets=1, starts=count)).starts


def _without_camera(agent: Agent, seed: int, start: Floats) -> Session:
    """Session of the same robot, whose camera is off."""
    env = make_env("Posture", seed, max_episode_steps=NO_END, camera=False)
    return Session(env, agent, seed, None, {"posture": start, "target": start})


def pushes(session: Session, posture: Floats, sizes: Sizes) -> list[dict[str, Any]]:
    """Ask for the stiffness of joints at a posture, and measure it by pushes both ways.

    Returns:
        For each: joint, asked and predicted and measured stiffness [N m/rad], stiffness of muscles
        [N/m], largest tension [N].
    """
    agent, result = session.agent, []
    assert agent.motors is not None
    usual = agent.motors.stiffness
    for joint in sizes.joints:
        for share in sizes.shares:
            agent.set_stiffness(usual)
            session.move(posture, sizes.move)
            asked = share * agent.set_stiffness(usual).joints[joint]
            found = agent.set_stiffness({joint: asked}, (0.05 * usual, MOST_ASKED))
            session.wait(2.0 * sizes.settle)
            tension = float(session.log.tensions[-1].max())
            measured = push(session, joint, asked * np.radians(sizes.bend), sizes.settle)
            result.append(
                {
                    "joint": joint,
                    "asked": round(asked, 3),
                    "predicted": round(found.joints[joint], 3),
                    "measured": round(measured, 3),
                    "muscles": [
                        round(float(k)) for k in (found.muscles.min(), found.muscles.max())
                    ],
                    "tension_N": round(tension, 1),
                }
            )
    return result


def push(session: Session, joint: str, torque: float, settle: float) -> float:
    """Stiffness of a joint [N m/rad] by torques on it alone, in both directions.

    Args:
        session: of a robot at rest.
        joint: its name.
        torque: of the push [N m]; half of it comes first, and the difference counts.
        settle: time until it rests [s].
    """
    robot, number = session.world.robot, session.world.joints.index(joint)
    dof = int(robot.model.joint(joint).dofadr[0])
    moved = 0.0
    for side in (1.0, -1.0):
        angles = []
        for share in (0.5, 1.0):
            robot.data.qfrc_applied[dof] = side * share * torque
            session.wait(settle)
            angles.append(float(session.truth["joint_angles"][number]))
        moved += side * (angles[1] - angles[0])
        robot.data.qfrc_applied[dof] = 0.0
        session.wait(settle)
    return torque / max(moved, 1e-9)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors and tensions by stiffness, and asked against measured stiffness."""
    from experiments.stiffness_and_load.figures import pictures

    return Findings(
        metrics(results, sizes.stiffness)
        | load_metrics(results, sizes.loads)
        | friction_metrics(results, sizes.stiffness),
        per_seed(results),
        [
            *tables(results, sizes.stiffness),
            load_table(results, sizes.loads),
            friction_table(results, sizes.stiffness),
        ],
        pictures(results, sizes.stiffness),
        {},
    )


EXPERIMENT = Experiment(
    name="stiffness-and-load",
    title="Stiffness of the muscles, and loads in the hand",
    introduction=(
        "Actual robots learn at 30 N/mm. Then the stiffness of their muscles is set, and they move "
        "to postures that they did not learn from, without learning. Joints are asked for a "
        "stiffness, and pushed. Loads are put into the hand, and their masses estimated."
    ),
    figure="beyond the paper",
    conditions=tuple(AGENTS),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
    others=("experiments/posture_accuracy",),
)


@dataclass(frozen=True)
class Args(common.Args):
    """Soft muscles: errors, tensions, and the stiffness that a push shows."""

    seeds: str = "0-9"
    out: Path = Path("out/stiffness-and-load")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)
