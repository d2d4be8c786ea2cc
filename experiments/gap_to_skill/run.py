"""From gap to skill: does a diagnosis of one minute of motion make the robot move better?

An actual robot moves for a minute with commands from the drawing. `reality_gap` diagnoses what it
felt and saw, and extends the drawing by what it found. A second agent gets the map of the extended
model. Both move to new postures before and after the same online learning.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments.gap_to_skill.extended_arm import ExtendedArm, extended_map
from experiments.gap_to_skill.tables import DRAWN, EXTENDED, metrics, seed_entry, tables
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Findings, Results, Study
from experiments.posture_accuracy.run import AWAY, away, trials
from experiments.posture_accuracy.run import Sizes as Trials
from jmm_agent.agent import AgentOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.types import Floats
from kengoro.arm import ACTUAL, make_agent, make_session, shuffled_postures
from kengoro.nominal_model import study_model, zero_lengths
from kengoro.recording import Tour, record, whole_arm
from kengoro.study_writer import write_study
from kengoro.trained_maps import nominal_model, trained_map
from kengoro.visits import no_visits, visit
from kengoro_env.postures import posture_set
from reality_gap import Diagnosis, diagnose, load_study


@dataclass(frozen=True)
class Sizes:
    """How much is done.

    Attributes:
        recorded: postures that are visited while it is recorded.
        go, stay: duration of a movement, and of a stay, while it is recorded [s].
        learned: postures from which is learned online.
        targets: new postures.
        starts: start postures of the trials to each of them.
        move: duration of a movement [s].
        patience: longest wait for rest and a look [s].
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

DIAGNOSED = AgentOptions(prior=PriorOptions(offset=0.002, shape=0.001))
"""An extended model is believed to be less wrong than the drawing: by lengths of 2 mm, not 25."""


class Plan(NamedTuple):
    """Postures of a robot [rad], each a row: where it wakes, what it learns from online, from where
    to which new postures it is sent, and what it visits while it is recorded."""

    first: Floats
    learned: Floats
    starts: Floats
    targets: Floats
    recorded: Floats


def make_plan(seed: int, sizes: Sizes) -> Plan:
    """Choose postures by chance; targets at least `AWAY` from all that the robot knows by then.

    Raises:
        ExperimentError: the posture set has not enough postures that far away.
    """
    postures = shuffled_postures(seed)
    ends = np.cumsum([1, sizes.learned, sizes.starts, sizes.recorded])
    first, learned, starts, recorded, rest = np.split(postures, ends)
    far = rest[away(rest, np.vstack([learned, recorded]))[0] >= AWAY]
    if len(far) < sizes.targets:
        raise ExperimentError(
            f"Only {len(far)} postures are {AWAY:g} deg away from all that the robot knows, "
            f"{sizes.targets} are needed."
        )
    return Plan(first[0], learned, starts, far[: sizes.targets], recorded)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """One robot: trials, online learning with both updaters, the same trials again; where the
    condition says so, recorded and diagnosed before all that."""
    plan, told = make_plan(seed, sizes), None
    if condition == EXTENDED:
        diagnosis = diagnose_robot(seed, plan.recorded, sizes)
        agent = make_agent(map_of(diagnosis), seed, DIAGNOSED)
        told = what_was_found(diagnosis)
    else:
        agent = make_agent(trained_map(cache), seed)
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
    return {"before": before, "after": after, "starts": sizes.starts, "diagnosis": told}


def diagnose_robot(seed: int, postures: Floats, sizes: Sizes) -> Diagnosis:
    """Record an actual robot that visits postures (K, n) [rad], and diagnose it."""
    arm = whole_arm()
    recording = record(arm, seed, Tour(postures, sizes.go, sizes.stay), seed)
    with tempfile.TemporaryDirectory() as folder:
        path = write_study(Path(folder), "head and arm", arm, [recording])
        return diagnose(load_study(path))


def map_of(diagnosis: Diagnosis) -> JointMuscleMap:
    """The map of the model that a diagnosis extended."""
    muscles = nominal_model().muscles
    zero = zero_lengths(study_model(whole_arm().scene), muscles)
    return extended_map(ExtendedArm(diagnosis.extended_xml, muscles, zero), posture_set())


def what_was_found(diagnosis: Diagnosis) -> dict[str, Any]:
    """A diagnosis in short."""
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
    """RMSE_joint and Distance_hand before and after learning, from both models."""
    from experiments.gap_to_skill.figures import pictures

    per_seed = {
        seed: {name: seed_entry(result[name]) for name in (DRAWN, EXTENDED)}
        for seed, result in results.items()
    }
    return Findings(metrics(per_seed), per_seed, tables(per_seed), pictures(results), {})


STUDY = Study(
    name="gap-to-skill",
    title="From gap to skill: the map of the diagnosed model",
    introduction=(
        "An actual robot moves for a minute by the map of the drawing. What it feels and sees is "
        "diagnosed by reality_gap, which extends the drawing by the causes that it finds. A map "
        "trained on the extended model, on the commands under which it settles, moves the robot "
        "to new postures, beside the map of the drawing; both before and after the same online "
        "learning from other postures."
    ),
    figure="beyond the paper",
    others=("experiments/posture_accuracy", "reality_gap"),
    conditions=(DRAWN, EXTENDED),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)
