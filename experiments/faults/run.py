"""Faults in the middle of learning: is each noticed, is nothing lost, and is nobody hurt?

A robot learns for a while. From there on, again and again from the same state, one thing after the
other goes wrong for some time, and then it goes on learning without a fault. Only a wire that
snapped does not heal.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.faults.injection import MOTORS, FaultyEnv, Injection
from experiments.faults.tables import NO_FAULT, metrics, seed_entry, tables
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Findings, Results, Study, run_study
from experiments.robots.accuracy import MapAccuracy
from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.guard import faults
from jmm_agent.guard.guard import Guard
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.hold_out import HoldOutOptions
from jmm_agent.vision.marker_detector import Detector, MarkerDetector
from kengoro.arm import ACTUAL, CAMERA, NO_END, SIDES, make_env, new_agent, shuffled_postures
from kengoro.session import Session
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.robot.nominal_model import NominalArm

MUSCLE_FAULTS = (
    faults.ENCODER_STUCK,
    faults.ENCODER_JUMP,
    faults.TENSION_SENSOR_DEAD,
    faults.MUSCLE_SNAPPED,
)
TRIALS = (
    NO_FAULT,
    faults.MARKER_HIDDEN,
    faults.SECOND_MARKER,
    faults.MIRRORED_MARKER,
    faults.CAMERA_FROZEN,
    *MUSCLE_FAULTS,
    faults.COMMAND_LATE,
    faults.PUSHED,
)
"""What goes wrong, one after the other."""


@dataclass(frozen=True)
class Sizes:
    """How long everything takes.

    Attributes:
        learning: before anything goes wrong [s].
        fault: with the fault [s].
        after: without it again [s].
        move: duration of a movement [s].
        patience: longest wait for rest and a look [s].
        tested: number of postures over which the map's error is taken.
        trials: which faults.
    """

    learning: float = 90.0
    fault: float = 10.0
    after: float = 60.0
    move: float = 1.5
    patience: float = 1.0
    tested: int = 50
    trials: tuple[str, ...] = TRIALS


@dataclass(frozen=True)
class Args(common.Args):
    """Faults in the middle of learning: is each noticed, and does it leave the map as it was?

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        learning: time before anything goes wrong [s].
        fault: time with each fault [s].
        after: time without it again [s].
    """

    seeds: str = "0-9"
    out: Path = Path("out/faults")
    learning: float = 90.0
    fault: float = 10.0
    after: float = 60.0


QUICK = Sizes(learning=8.0, fault=6.0, after=6.0, tested=10)


class Life:
    """A robot with faults and its guarded agent, on their way from posture to posture.

    Args:
        seed: of the robot.
        cache: folder of trained maps.
        sizes: durations.
    """

    def __init__(self, seed: int, cache: Path | None, sizes: Sizes) -> None:
        self._sizes, self._postures, self._visited = sizes, shuffled_postures(seed), 0
        self._detector = MarkerDetector(CAMERA, SIDES)
        env = make_env("Posture", seed, max_episode_steps=NO_END)
        self.env = FaultyEnv(env, self._detector)
        self.agent = guarded_agent(seed, cache, self.env.detector)
        start = self._postures[0]
        options = {"posture": start, "target": start}
        self.session = Session(self.env, self.agent, seed, None, options)
        self.named: dict[tuple[str, str], list[float]] = {}
        """When each fault was noticed [s], by kind and where."""
        self.largest_tension = 0.0
        self.not_finite = 0

    def twin(self) -> Life:
        """The same life, to be lived on by itself from here."""
        shared = (self.agent.kinematics, self._detector, self.agent.map, self._postures)
        return deepcopy(self, {id(thing): thing for thing in shared})

    def live(self, duration: float) -> None:
        """Go from posture to posture for some time [s]."""
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


def guarded_agent(seed: int, cache: Path | None, detector: Detector) -> Agent:
    """An agent that knows the drawing, watches over its robot and undoes harmful updates."""
    options = AgentOptions(vision=VisionOptions(hold_out=HoldOutOptions()))
    agent = new_agent(cache, seed, options=options, detector=detector)
    gravity = NominalArm(asset_path(ARM)).gravity
    agent.guard = Guard(agent.map.muscles, agent.kinematics, CAMERA, gravity, MOTORS)
    return agent


def injection(kind: str, seed: int, muscles: Sequence[str]) -> Injection | None:
    """The fault of a kind on the robot of a seed: at a wire, or with a push, drawn by chance."""
    if kind == NO_FAULT:
        return None
    rng = np.random.default_rng([seed, 7, TRIALS.index(kind)])
    muscle = str(rng.choice(muscles)) if kind in MUSCLE_FAULTS else ""
    direction = rng.standard_normal(3)
    x, y, z = (direction / np.linalg.norm(direction)).tolist()
    return Injection(kind, muscle, (x, y, z))


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """One robot: it learns, and from there each fault comes, stays and goes."""
    life, accuracy = Life(seed, cache, sizes), MapAccuracy(seed, sizes.tested)
    life.live(sizes.learning)
    trials = {kind: trial(life.twin(), accuracy, kind, seed, sizes) for kind in sizes.trials}
    life.env.close()
    return {"learning": told(life, 0.0, sizes.learning), "trials": trials}


def trial(life: Life, accuracy: MapAccuracy, kind: str, seed: int, sizes: Sizes) -> dict[str, Any]:
    """One fault comes at a time drawn by chance, stays and goes."""
    rng = np.random.default_rng([seed, 9, TRIALS.index(kind)])
    life.live(float(rng.uniform(0.0, sizes.move + sizes.patience)))
    life.named.clear()
    injected = injection(kind, seed, life.env.world.muscles)
    before, begin = accuracy.error_mm(life.agent), life.session.time
    life.env.largest_demand = life.largest_tension = 0.0
    life.env.inject(injected)
    life.live(sizes.fault)
    gone, shown = life.session.time, life.env.shown
    if kind != faults.MUSCLE_SNAPPED:
        life.env.inject(None)
        life.live(sizes.after)
    life.env.close()
    return {
        "kind": kind,
        "where": "" if injected is None else injected.where,
        "begin": begin,
        "shown": shown,
        "gone": gone,
        "before_mm": before,
        "after_mm": accuracy.error_mm(life.agent),
        "still_named": [fault.kind for fault in life.agent.faults],
        **told(life, begin, life.session.time),
    }


def told(life: Life, begin: float, end: float) -> dict[str, Any]:
    """What a life tells of the time from ``begin`` to ``end`` [s]."""
    return {
        "seconds": end - begin,
        "named": [[*what, times] for what, times in life.named.items()],
        "largest_demand_N": life.env.largest_demand,
        "largest_tension_N": life.largest_tension,
        "not_finite": life.not_finite,
        "taken_back": life.agent.taken_back,
    }


def main(args: Args) -> Summary:
    """Run all robots, or what of it is missing; write summary and report.

    Raises:
        ExperimentError: a duration is not positive.
    """
    if min(args.learning, args.fault, args.after) <= 0:
        raise ExperimentError("learning, fault and after are times in seconds, above 0.")
    sizes = replace(STUDY.sizes, learning=args.learning, fault=args.fault, after=args.after)
    return run_study(replace(STUDY, sizes=sizes), args)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """How soon each fault was noticed, and what it did to the map and the wires."""
    per_seed = {seed: seed_entry(result[ACTUAL]) for seed, result in results.items()}
    told = tables(per_seed)
    more = {"tables": [table.plain() for table in told[1:]]}
    return Findings(metrics(per_seed), per_seed, told, (), more)


STUDY = Study(
    name="faults",
    title="Faults in the middle of learning",
    introduction=(
        "A robot learns. From there, each time from the same state, one thing goes wrong for some "
        "time, and then it goes on learning without a fault. The agent must "
        "notice and name each fault, keep it out of the map, and never command more tension than "
        "the motors may pull with."
    ),
    figure="beyond the paper",
    conditions=(ACTUAL,),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)
