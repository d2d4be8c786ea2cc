"""Looks that are wrong, and pass for right: is what they teach noticed, and undone?

A robot at rest is looked at in one posture after the other; its own lengths and the marker's true
pose are what the agent is given. Some looks are wrong: the marker is not where it seems. The
agent learns from all that it believes, with and without looks held back to test updates on.
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
from experiments.harness.experiment import Findings, Results, Study, run_study
from experiments.harness.report import Picture, Table
from experiments.harness.statistics import metric
from experiments.robots.accuracy import MapAccuracy
from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.hold_out import HoldOutOptions
from kengoro.arm import new_agent, shuffled_postures
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual
from kengoro_env.robot.robot import Robot

PLAIN, TESTED, RIGHT, RIGHT_TESTED = "plain", "tested", "right", "right-tested"
CONDITIONS = (PLAIN, TESTED, RIGHT, RIGHT_TESTED)
TOLD = {
    PLAIN: "wrong looks, none held back",
    TESTED: "wrong looks, some held back",
    RIGHT: "right looks only, none held back",
    RIGHT_TESTED: "right looks only, some held back",
}
KINDS = {"60 mm and 23 deg": (60.0, 23.0), "150 mm": (150.0, 0.0), "20 mm and 8 deg": (20.0, 8.0)}
"""By how much the marker seems displaced and turned, each in a direction drawn by chance."""

HARM = 1.2
"""An update that raises the map's error by this factor did harm."""

STEPS, PERIOD = 25, 0.02
CALM = 50.0
"""Tension of each wire [N], far from what saturates a motor."""

NOISE_POSITION, NOISE_ROTATION = 0.001, 0.005
"""Standard deviation of each part of a right look, too [m, rad]."""


@dataclass(frozen=True)
class Sizes:
    """How much each robot is looked at.

    Attributes:
        looks: number of postures, a look in each.
        first, every: the first wrong look, and how many looks on the next one comes.
        tested: number of postures over which the map's error is taken.
    """

    observations: int = 28
    first: int = 12
    every: int = 3
    tested: int = 50

    def kind(self, look: int) -> str:
        """What is wrong with a look; empty if nothing."""
        since, rest = divmod(look - self.first, self.every)
        return list(KINDS)[since % len(KINDS)] if look >= self.first and not rest else ""


@dataclass(frozen=True)
class Args(common.Args):
    """Looks that are wrong, and pass for right: is what they teach noticed, and undone?"""

    seeds: str = "0-9"
    out: Path = Path("out/wrong-observations")


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """What became of each look, and of the map's error [mm]."""
    hold_out = HoldOutOptions() if condition in (TESTED, RIGHT_TESTED) else None
    agent = new_agent(cache, seed, options=AgentOptions(vision=VisionOptions(hold_out=hold_out)))
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
        outcome = look(agent, pose, robot.measured_lengths(), posture)
        after = accuracy.error_mm(agent)
        observations.append({"wrong": kind, "outcome": outcome, "before": before, "after": after})
        before = after
    return {"observations": observations}


def displaced(
    pose: Floats, far: float, turned: float, rng: np.random.Generator, exactly: bool = False
) -> Floats:
    """A pose (4, 4) moved and turned by chance: ``far`` [m] and ``turned`` [rad] in all, or as
    standard deviation along and about each axis."""
    move, turn = rng.standard_normal((2, 3))
    if exactly:
        move, turn = move / np.linalg.norm(move), turn / np.linalg.norm(turn)
    result = pose.copy()
    result[:3, 3] += far * move
    result[:3, :3] = Rotation.from_rotvec(turned * turn).as_matrix() @ pose[:3, :3]
    return result


def look(agent: Agent, pose: Floats, lengths: Floats, start: Floats) -> str:
    """Let an agent look at its robot at rest: "learned", "undone", "held back" or "refused"."""
    agent.estimator.reset(start)
    for _ in range(STEPS):
        agent.estimator.update(lengths, PERIOD)
    calm = np.full(len(lengths), CALM)
    seen = agent.vision.seen(pose, agent.joint_angles, lengths, lengths, calm)
    if seen.learned:
        agent.estimator.set_map(agent.map)
        return "learned"
    outcomes = ("undone", "held back")
    return next((name for name in outcomes if seen.reason.startswith(name)), "refused")


def main(args: Args) -> Summary:
    """Run all robots, or what of it is missing; write summary and report."""
    return run_study(STUDY, args)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """What became of wrong looks and of right ones, with and without looks held back."""
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
        "cost_of_holding_back": metric(cost, ""),
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
        "condition", "look wrong by", "observations", "refused", "undone", "held back", "learned",
        f"of these harmful (x {HARM:g})", "map's error after / before, worst",
    )  # fmt: skip
    note = (
        f"{len(results)} robots, {sizes.observations} looks each. The map's error is the median "
        f"over {sizes.tested} postures of its RMS difference from the robot's own lengths. "
        "Refused: no posture explains the look and the lengths together."
    )
    table = Table("What became of looks", head, rows, note)
    return Findings(metrics, per_seed, [table], [picture(found, sizes)], {})


def _worst(observations: Sequence[Mapping[str, Any]]) -> float:
    """The largest factor by which one wrong look raised the map's error."""
    return max([x["after"] / x["before"] for x in observations if x["wrong"]], default=1.0)


def row(name: str, kind: str, observations: Sequence[Mapping[str, Any]]) -> list[object]:
    """What became of looks of one kind."""
    ratios = [x["after"] / x["before"] for x in observations]
    counts = [
        sum(x["outcome"] == outcome for x in observations)
        for outcome in ("refused", "undone", "held back", "learned")
    ]
    harmful = sum(ratio > HARM for ratio in ratios)
    worst = f"{max(ratios, default=1.0):.2f}"
    return [TOLD[name], kind or "nothing", len(observations), *counts, harmful, worst]


def picture(found: Mapping[str, Sequence[Sequence[Mapping[str, Any]]]], sizes: Sizes) -> Picture:
    """The map's error look by look."""
    from matplotlib import pyplot

    from experiments.harness.report import png

    figure, axes = pyplot.subplots(figsize=(9, 4.2))
    for name, style in zip(CONDITIONS, ("C3-", "C0-", "0.6", "C0:"), strict=True):
        errors = np.median(
            [[x["after"] for x in observations] for observations in found[name]], axis=0
        )
        axes.plot(np.arange(1, len(errors) + 1), errors, style, label=TOLD[name])
    wrong = [k + 1 for k in range(sizes.observations) if sizes.kind(k)]
    axes.plot(wrong, np.zeros(len(wrong)), "k^", clip_on=False, label="a wrong look")
    axes.set(
        xlabel="observation", ylabel="error of the map, median over robots [mm]", ylim=(0, None)
    )
    axes.legend(frameon=False, fontsize=9)
    figure.tight_layout()
    image = png(figure)
    pyplot.close(figure)
    return Picture("The map's error, look by look", image, "One look in each posture.")


STUDY = Study(
    name="wrong-observations",
    title="Looks that are wrong, and pass for right",
    introduction=(
        "A robot is looked at in one posture after the other. Some looks are wrong: the marker is "
        "not where it seems. The agent learns from all that it believes. Every fifth look is held "
        "back, and an update with which these looks are explained much worse is undone."
    ),
    figure="beyond the paper",
    others=("experiments/faults",),
    conditions=CONDITIONS,
    sizes=Sizes(),
    quick=Sizes(observations=18, first=12, every=2, tested=10),
    run=run,
    conclude=conclude,
)
