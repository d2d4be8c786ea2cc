"""Arrays of a memory file: their shapes, and those of what is known of rests and wiring."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple

import numpy as np

from jmm_agent.guard.faults import (
    MUSCLE_ABSENT,
    MUSCLE_REVERSED,
    MUSCLE_SNAPPED,
    MUSCLE_UNSTABLE,
    MUSCLES_SWAPPED,
)
from jmm_agent.mapping.array_file import ArrayFileError, Arrays
from jmm_agent.mapping.learner import Pairs
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.types import Floats
from jmm_agent.updaters.assignment import Assignment
from jmm_agent.updaters.rest_fitter import RestMemory
from jmm_agent.updaters.wiring_evidence import Miswiring
from jmm_agent.vision.camera_unknowns import UNKNOWNS
from jmm_agent.vision.length_drift import LengthDrift
from jmm_agent.vision.pose_errors import JointPrior
from jmm_agent.vision.prior_widths import PriorWidths
from jmm_agent.vision.rest_fit import Rest

MISWIRINGS = (
    MUSCLES_SWAPPED, MUSCLE_REVERSED, MUSCLE_ABSENT, MUSCLE_SNAPPED, MUSCLE_UNSTABLE
)  # fmt: skip
"""Kinds of findings about the wiring, by their number in the file."""

SHAPES: dict[str, tuple[str | int, ...]] = {
    "pose": ("K", 4, 4),
    "lengths": ("K", "m"),
    "guess": ("K", "n"),
    "frames": ("K", 2),
    "covariance": ("K", 6, 6),
    "joint_angles": ("K", "n"),
    "tensions": ("K", "m"),
    "commands": ("K", "m"),
    "sound": ("K",),
    "angles": ("K", "n"),
    "elongated": ("K", "m"),
    "last": ("L", "n"),
    "zero": ("Z", "n"),
    "widths": ("Z", 4),
    "unbalanced": ("U",),
    "camera": ("Y", UNKNOWNS),
    "drift": (),
    "misplaced": ("J", 2),
    "ages": ("T",),
    "rest_lengths": ("R", "m"),
    "rest_tensions": ("R", "m"),
    "rest_guess": ("R", "n"),
    "channels": ("m",),
    "left_out": ("m",),
    "miswired": ("W", 3),
    "posture": ("n",),
    "in_use": ("m",),
    "counts": (2,),
    **{
        f"{kind}_{part}": shape
        for kind, rows in (("vision", "V"), ("antagonism", "A"), ("held_out", "H"))
        for part, shape in zip(Pairs._fields, ((rows, "n"), (rows, "m"), (rows,)), strict=True)
    },
}
"""Shapes of the arrays: n joints, m muscles, K observations; other letters are other counts."""

ELEMENTS = {"sound": "b", "frames": "U"}
"""Kinds of the elements of arrays that do not hold numbers."""


OF_MUSCLES = (
    "lengths",
    "commands",
    "rest_lengths",
    "vision_lengths",
    "antagonism_lengths",
    "held_out_lengths",
)
"""Arrays in which NaN stands for a muscle that was out of use."""


def updated(content: Arrays, muscles: int) -> Arrays:
    """Arrays of a file of an earlier format, with what is usual where it holds nothing.

    Args:
        content: arrays of the file.
        muscles: number of muscles, m.
    """
    usual = {
        "drift": np.array(0.0),
        "misplaced": np.empty((0, 2)),
        "ages": np.zeros(len(content.get("angles", ()))),
        "camera": np.empty((0, UNKNOWNS)),
        "in_use": np.ones(muscles),
        **arrays_of_assignment(Assignment(), muscles),
    }
    found = usual | content
    widths = found.get("widths", np.empty(0))
    if widths.ndim == 2 and widths.shape[1] == 3:
        usual_ratio = PriorOptions().points / PriorOptions().zeroed_offset
        found["widths"] = np.column_stack([widths, usual_ratio * widths[:, 0]])
    return found


def arrays_of_rests(memory: RestMemory, joints: int, muscles: int) -> Arrays:
    """Arrays of what is known from rests; without rows where that is nothing."""
    rests = memory.rests
    return {
        "zero": np.empty((0, joints)) if memory.zero is None else memory.zero[None],
        "widths": np.empty((0, 4)) if memory.widths is None else np.array(memory.widths)[None],
        "unbalanced": np.array([] if memory.unbalanced is None else [memory.unbalanced]),
        "camera": np.empty((0, UNKNOWNS)) if memory.camera is None else memory.camera[None],
        "drift": np.array(memory.drift.speed),
        "ages": memory.drift.ages,
        "misplaced": np.array([] if memory.joints is None else astuple(memory.joints)).reshape(
            -1, 2
        ),
        "rest_lengths": np.array([rest.lengths for rest in rests]).reshape(-1, muscles),
        "rest_tensions": np.array([rest.tensions for rest in rests]).reshape(-1, muscles),
        "rest_guess": np.array([rest.guess for rest in rests]).reshape(-1, joints),
    }


def rests_of(arrays: Mapping[str, Floats]) -> RestMemory:
    """What arrays of `arrays_of_rests` hold."""
    parts = (arrays[f"rest_{part}"] for part in Rest._fields)
    rests = tuple(Rest(*row) for row in zip(*parts, strict=True))
    drift = LengthDrift(float(arrays["drift"]), arrays["ages"])
    if not len(arrays["zero"]):
        return RestMemory(rests=rests, drift=drift)
    widths = PriorWidths(*arrays["widths"][0].tolist())
    unbalanced = float(arrays["unbalanced"][0]) if len(arrays["unbalanced"]) else None
    camera = arrays["camera"][0] if len(arrays["camera"]) else None
    joints = JointPrior(*arrays["misplaced"][0].tolist()) if len(arrays["misplaced"]) else None
    return RestMemory(arrays["zero"][0], widths, rests, unbalanced, camera, drift, joints)


def arrays_of_assignment(assignment: Assignment, muscles: int) -> Arrays:
    """Arrays of what is known of the wiring; refused observations are not kept."""
    rows = [
        (MISWIRINGS.index(one.kind), one.muscles[0], one.muscles[-1]) for one in assignment.named
    ]
    return {
        "channels": assignment.channels(muscles),
        "left_out": assignment.mask(muscles).astype(int),
        "miswired": np.array(rows, dtype=int).reshape(-1, 3),
    }


def assignment_of(arrays: Mapping[str, Floats]) -> Assignment:
    """What arrays of `arrays_of_assignment` hold.

    Raises:
        ArrayFileError: channels are not each muscle's own, or a kind or muscle is unknown.
    """
    channels, rows = arrays["channels"].astype(int), arrays["miswired"].astype(int)
    muscles = len(channels)
    known = rows.size == 0 or (rows.min() >= 0 and rows[:, 0].max() < len(MISWIRINGS))
    known = known and (rows.size == 0 or rows[:, 1:].max() < muscles)
    if not known or sorted(channels.tolist()) != list(range(muscles)):
        raise ArrayFileError("its wiring is that of no robot")
    own = np.array_equal(channels, np.arange(muscles))
    named = [
        Miswiring(MISWIRINGS[kind], (first,) if first == last else (first, last))
        for kind, first, last in rows.tolist()
    ]
    out = tuple(np.flatnonzero(arrays["left_out"]).tolist())
    return Assignment(() if own else tuple(channels.tolist()), out, tuple(named))
