"""From gap to skill: accuracy with the map of a model that was diagnosed from one minute of motion.

An actual robot moves for a minute with commands from the nominal model. `reality_gap` diagnoses its
log and extends the nominal model by the causes that it finds. A second agent gets the map of the
extended model. Both move to new postures before and after the same online learning.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments.gap_to_skill.extended_arm import ExtendedArm, extended_map
from experiments.gap_to_skill.tables import EXTENDED, NOMINAL, metrics, seed_entry, tables
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.posture_accuracy.run import AWAY, away, trials
from experiments.posture_accuracy.run import Sizes as Trials
from experiments.robots.conditions import ACTUAL, make_session
from jmm_agent.agent import AgentOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.recording import Tour, record_episode, whole_arm
from kengoro.robots import shuffled_postures
from kengoro.study_model import study_model, zero_lengths
from kengoro.study_writer import write_study
from kengoro.trained_maps import nominal_model
from kengoro.visits import no_visits, visit
from kengoro_env.postures import posture_set
from reality_gap import Diagnosis, diagnose, load_study


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        recorded: number of postures in the log.
        go, stay: duration of a movement and of a stay in the log [s].
        learned: number of postures to learn from online.
        targets: number of new postures.
        starts: number of start postures of the trials to each new posture.
        move: duration of a movement [s].
        patience: longest wait for rest and an observation [s].
    """

    recorded: int = 30
    go: float = 1.0
    stay: float = 1.0
    learned: int = 27
    targets: int = 5
    starts: int = 4
    move: float = 2.0
    patience: float = 2.5


QUICK = Sizes(recorded=10, learned=2, targets=1, starts=1, move=1.0, patience=1.5)

DIAGNOSED = AgentOptions(prior=PriorOptions(offset=0.002, shape=0.001, zero_posture=0.0))
"""Prior for an extended model: errors of lengths of 2 mm instead of 25 mm."""


class Plan(NamedTuple):
    """Postures of a robot, one in each row [rad].

    Attributes:
        first: initial posture.
        learned: postures to learn from online.
        starts, targets: start postures of the trials, and new postures.
        recorded: postures in the log.
    """

    first: Floats
    learned: Floats
    starts: Floats
    targets: Floats
    recorded: Floats


def make_plan(seed: int, sizes: Sizes) -> Plan:
    """Choose postures in random order, with targets at least `AWAY` from all known postures.

    Raises:
        ExperimentError: too few postures of the set are that far away.
    """
    postures = shuffled_postures(seed)
    ends = np.cumsum([1, sizes.learned, sizes.starts, sizes.recorded])
    first, learned, starts, recorded, rest = np.split(postures, ends)
    far = rest[away(rest, np.vstack([learned, recorded]))[0] >= AWAY]
    if len(far) < sizes.targets:
        raise ExperimentError(
            f"Only {len(far)} postures are {AWAY:g} deg away from all known postures, "
            f"{sizes.targets} are needed."
        )
    return Plan(first[0], learned, starts, far[: sizes.targets], recorded)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Run one robot: trials, online learning with both updaters, and the same trials again.

    In the condition `EXTENDED` it is recorded and diagnosed before.
    """
    plan, summary = make_plan(seed, sizes), None
    if condition == EXTENDED:
        diagnosis = diagnose_robot(seed, plan.recorded, sizes)
        agent = make_agent(seed, jmm=map_of(diagnosis), options=DIAGNOSED)
        summary = diagnosis_summary(diagnosis)
    else:
        agent = make_agent(seed, cache=cache)
    session = make_session(ACTUAL, seed, agent, plan.first)
    usual = Trials(move=sizes.move, patience=sizes.patience)
    agent.learning = False
    before = trials(session, plan.targets, plan.starts, usual)
    agent.learning = True
    lesson = no_visits()
    for posture in plan.learned:
        visit(session, posture, lesson, sizes.move, sizes.patience)
    agent.learning = False
    after = trials(session, plan.targets, plan.starts, usual)
    session.env.close()
    return {"before": before, "after": after, "starts": sizes.starts, "diagnosis": summary}


def diagnose_robot(seed: int, postures: Floats, sizes: Sizes) -> Diagnosis:
    """Record an actual robot that visits postures, shape (K, n) [rad], and diagnose it."""
    with tempfile.TemporaryDirectory() as folder:
        return diagnose(load_study(record_robot(seed, postures, sizes, Path(folder))))


def record_robot(seed: int, postures: Floats, sizes: Sizes, folder: Path) -> Path:
    """Record an actual robot that visits postures, shape (K, n) [rad]; the path of the study."""
    arm = whole_arm()
    recording = record_episode(arm, seed, Tour(postures, sizes.go, sizes.stay), seed)
    return write_study(folder, "head and arm", arm.scene, [recording])


def map_of(diagnosis: Diagnosis) -> JointMuscleMap:
    """Map of the extended model of a diagnosis."""
    muscles = nominal_model().muscles
    zero = zero_lengths(study_model(whole_arm().scene), muscles)
    return extended_map(ExtendedArm(diagnosis.extended_xml, muscles, zero), posture_set())


def diagnosis_summary(diagnosis: Diagnosis) -> dict[str, Any]:
    """Summary of a diagnosis, for JSON."""
    return {
        "verdict": diagnosis.verdict.value,
        "causes": [
            {
                "cause": named.candidate.cause.id,
                "location": str(named.candidate.location)[:80],
                "parameters": len(named.parameters),
                "confidence": round(named.confidence, 3),
            }
            for named in diagnosis.causes
        ],
        "rms_before": round(diagnosis.rms_before, 3),
        "rms_after": round(diagnosis.rms_after, 3),
        "gain": None if diagnosis.gain is None else round(diagnosis.gain.value, 3),
        "seconds": round(diagnosis.seconds, 1),
    }


def conclude(results: Results, sizes: Sizes) -> Findings:
    """RMSE_joint and Distance_hand before and after learning, with both maps."""
    from experiments.gap_to_skill.figures import pictures

    per_seed = {
        seed: {name: seed_entry(result[name]) for name in (NOMINAL, EXTENDED)}
        for seed, result in results.items()
    }
    return Findings(metrics(per_seed), per_seed, tables(per_seed), pictures(results), {})


EXPERIMENT = Experiment(
    name="gap-to-skill",
    title="From gap to skill: the map of the diagnosed model",
    introduction=(
        "An actual robot moves for a minute by the map of the nominal model. Its log is diagnosed "
        "by reality_gap, which extends the nominal model by the causes that it finds. Then the map "
        "of the extended model, trained on the commands with which it settles, and the map of the "
        "nominal model move the robot to new postures, before and after the same online learning "
        "from other postures."
    ),
    figure="beyond the paper",
    others=("experiments/posture_accuracy", "reality_gap"),
    conditions=(NOMINAL, EXTENDED),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """A diagnosis of one minute of motion becomes a joint-muscle mapping."""

    seeds: str = "0-9"
    out: Path = Path("out/gap-to-skill")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)
