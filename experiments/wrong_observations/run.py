"""Wrong marker observations: detection of updates from them, with observations held out.

A robot is observed at rest in one posture after the other. The agent gets its muscle lengths and
the true pose of the marker. In some observations the pose is wrong. The agent learns from all
observations that it accepts, with and without observations that are held out to test updates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.harness.report import Picture, Table
from experiments.harness.statistics import metric
from experiments.robots.accuracy import MapAccuracy
from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.hold_out import HoldOutOptions
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual
from kengoro_env.robot.robot import Robot

PLAIN, TESTED, RIGHT, RIGHT_TESTED = "plain", "tested", "right", "right-tested"
CONDITIONS = (PLAIN, TESTED, RIGHT, RIGHT_TESTED)
LABELS = {
    PLAIN: "wrong observations, no hold-out",
    TESTED: "wrong observations, with hold-out",
    RIGHT: "right observations only, no hold-out",
    RIGHT_TESTED: "right observations only, with hold-out",
}
KINDS = {"60 mm and 23 deg": (60.0, 23.0), "150 mm": (150.0, 0.0), "20 mm and 8 deg": (20.0, 8.0)}
"""Displacement [mm] and rotation [deg] of the marker in wrong observations."""

HARM = 1.2
"""Factor of the map's error from which on an update counts as harmful."""

STEPS, PERIOD = 25, 0.02
"""Number of steps of the estimator for an observation, and their period [s]."""
CALM = 50.0
"""Tension of each muscle, far below saturation of the motors [N]."""

NOISE_POSITION, NOISE_ROTATION = 0.001, 0.005
"""Standard deviation of each component of all observed poses [m, rad]."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        observations: number of postures, with one observation each.
        first: index of the first wrong observation.
        every: number of observations between two wrong ones.
        tested: number of postures over which the error of the map is evaluated.
    """

    observations: int = 28
    first: int = 12
    every: int = 3
    tested: int = 50

    def kind(self, number: int) -> str:
        """Kind of a wrong observation; empty for right ones."""
        since, rest = divmod(number - self.first, self.every)
        return list(KINDS)[since % len(KINDS)] if number >= self.first and not rest else ""


@dataclass(frozen=True)
class Args(common.Args):
    """Detection of updates from wrong marker observations."""

    seeds: str = "0-9"
    out: Path = Path("out/wrong-observations")


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Run one robot; returns the outcome of each observation and the error of the map [mm]."""
    hold_out = HoldOutOptions() if condition in (TESTED, RIGHT_TESTED) else None
    options = AgentOptions(vision=VisionOptions(hold_out=hold_out))
    agent = make_agent(seed, options=options, cache=cache)
    robot, accuracy = Robot(asset_path(ARM), actual(seed)), MapAccuracy(seed, sizes.tested)
    rng, wrong = np.random.default_rng([seed, 12]), np.random.default_rng([seed, 13])
    observations = []
    before = accuracy.error_mm(agent)
    for number, posture in enumerate(shuffled_postures(seed)[: sizes.observations]):
        robot.reset(posture, rng)
        pose = agent.kinematics.pose("marker_hand", robot.joint_angles, relative_to="eye")
        pose = displaced(pose, NOISE_POSITION, NOISE_ROTATION, rng)
        kind = sizes.kind(number) if condition in (PLAIN, TESTED) else ""
        if kind:
            far, turned = KINDS[kind]
            pose = displaced(pose, 1e-3 * far, np.radians(turned), wrong, exactly=True)
        outcome = observe(agent, pose, robot.measured_lengths(), posture)
        after = accuracy.error_mm(agent)
        observations.append({"wrong": kind, "outcome": outcome, "before": before, "after": after})
        before = after
    return {"observations": observations}


def displaced(
    pose: Floats, far: float, turned: float, rng: np.random.Generator, exactly: bool = False
) -> Floats:
    """Displace and rotate a pose in random directions.

    Args:
        pose: homogeneous matrix, shape (4, 4).
        far: displacement [m].
        turned: rotation [rad].
        rng: chooses the directions.
        exactly: whether ``far`` and ``turned`` are total amounts, and not standard deviations along
            and about each axis.
    """
    move, turn = rng.standard_normal((2, 3))
    if exactly:
        move, turn = move / np.linalg.norm(move), turn / np.linalg.norm(turn)
    result = pose.copy()
    result[:3, 3] += far * move
    result[:3, :3] = Rotation.from_rotvec(turned * turn).as_matrix() @ pose[:3, :3]
    return result


def observe(agent: Agent, pose: Floats, lengths: Floats, start: Floats) -> str:
    """Give an observation at rest to an agent.

    Returns:
        "learned", "undone", "held out" or "rejected".
    """
    agent.estimator.reset(start)
    for _ in range(STEPS):
        agent.estimator.update(lengths, PERIOD)
    calm = np.full(len(lengths), CALM)
    seen = agent.vision.seen(pose, agent.joint_angles, lengths, lengths, calm)
    if seen.learned:
        agent.estimator.set_map(agent.map)
        return "learned"
    outcomes = {"undone": "undone", "held": "held out"}  # by the start of the reason
    found = (name for start, name in outcomes.items() if seen.reason.startswith(start))
    return next(found, "rejected")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Outcomes of wrong and right observations, with and without hold-out."""
    found = {
        name: [result[name]["observations"] for result in results.values()] for name in CONDITIONS
    }
    last = {
        name: [observations[-1]["after"] for observations in found[name]] for name in CONDITIONS
    }
    undone = [
        sum(x["outcome"] == "undone" for x in observations) for observations in found[RIGHT_TESTED]
    ]
    cost = [tested / plain for tested, plain in zip(last[RIGHT_TESTED], last[RIGHT], strict=True)]
    metrics = {
        "worst_ratio_plain": metric([_worst(observations) for observations in found[PLAIN]], ""),
        "worst_ratio_tested": metric(
            [_worst(observations) for observations in found[TESTED]], "", HARM
        ),
        "right_observations_undone": metric([float(count) for count in undone], "", 0.0),
        "cost_of_hold_out": metric(cost, ""),
        **{f"last_mm_{name}": metric(errors, "mm") for name, errors in last.items()},
    }
    per_seed = {
        seed: {
            name: {"last_mm": round(r[name]["observations"][-1]["after"], 3)} for name in CONDITIONS
        }
        for seed, r in results.items()
    }
    rows = [
        row(
            name,
            kind,
            [x for observations in found[name] for x in observations if x["wrong"] == kind],
        )
        for name in CONDITIONS
        for kind in (*KINDS, "")
        if kind == "" or name in (PLAIN, TESTED)
    ]
    head = (
        "condition", "observation wrong by", "observations", "rejected", "undone", "held out",
        "learned", f"of these harmful (x {HARM:g})", "map's error after / before, worst",
    )  # fmt: skip
    note = (
        f"{len(results)} robots, {sizes.observations} observations each. The error of the map is "
        f"the median over {sizes.tested} postures of the RMS difference from the robot's lengths. "
        "Rejected: no posture explains observation and lengths together."
    )
    table = Table("Outcomes of observations", head, rows, note)
    return Findings(metrics, per_seed, [table], [picture(found, sizes)], {})


def _worst(observations: Sequence[Mapping[str, Any]]) -> float:
    """Largest factor by which a wrong observation changed the error of the map."""
    return max([x["after"] / x["before"] for x in observations if x["wrong"]], default=1.0)


def row(name: str, kind: str, observations: Sequence[Mapping[str, Any]]) -> list[object]:
    """Row of the observations of one kind."""
    ratios = [x["after"] / x["before"] for x in observations]
    counts = [
        sum(x["outcome"] == outcome for x in observations)
        for outcome in ("rejected", "undone", "held out", "learned")
    ]
    harmful = sum(ratio > HARM for ratio in ratios)
    worst = f"{max(ratios, default=1.0):.2f}"
    return [LABELS[name], kind or "nothing", len(observations), *counts, harmful, worst]


def picture(found: Mapping[str, Sequence[Sequence[Mapping[str, Any]]]], sizes: Sizes) -> Picture:
    """Figure of the error of the map over observations."""
    from matplotlib import pyplot

    from experiments.harness.report import png

    figure, axes = pyplot.subplots(figsize=(9, 4.2))
    for name, style in zip(CONDITIONS, ("C3-", "C0-", "0.6", "C0:"), strict=True):
        errors = np.median(
            [[x["after"] for x in observations] for observations in found[name]], axis=0
        )
        axes.plot(np.arange(1, len(errors) + 1), errors, style, label=LABELS[name])
    wrong = [k + 1 for k in range(sizes.observations) if sizes.kind(k)]
    axes.plot(wrong, np.zeros(len(wrong)), "k^", clip_on=False, label="wrong observation")
    axes.set(
        xlabel="observation", ylabel="error of the map, median over robots [mm]", ylim=(0, None)
    )
    axes.legend(frameon=False, fontsize=9)
    figure.tight_layout()
    image = png(figure)
    pyplot.close(figure)
    return Picture("Error of the map over observations", image, "One observation in each posture.")


EXPERIMENT = Experiment(
    name="wrong-observations",
    title="Wrong marker observations",
    introduction=(
        "A robot is observed in one posture after the other. In some observations the pose of the "
        "marker is wrong. The agent learns from all observations that it accepts. Every fifth "
        "observation is held out, and an update is undone if it explains these much worse."
    ),
    figure="beyond the paper",
    conditions=CONDITIONS,
    sizes=Sizes(),
    quick=Sizes(observations=18, first=12, every=2, tested=10),
    run=run,
    conclude=conclude,
)
