"""File of what an agent has learned, from which another agent continues to the bit.

The file (.npz without pickle) holds all layers of the map, what both updaters remember with all
marker observations, the held-out pairs, the last posture and the state of the random generator.
It names its format, the robot's joints and muscles, and a fingerprint of the nominal map, because
corrections of one nominal map do not apply to another one. `read_memory` refuses a file that does
not fit before anything of an agent changes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jmm_agent.errors import AgentError
from jmm_agent.mapping.array_file import ArrayFileError, Arrays, read_arrays, write_arrays
from jmm_agent.mapping.group_map import LARGEST, Layers
from jmm_agent.mapping.joint_muscle_map import CheckpointError, JointMuscleMap, fingerprint
from jmm_agent.mapping.learner import Pairs
from jmm_agent.memory_arrays import (
    ELEMENTS,
    OF_MUSCLES,
    SHAPES,
    arrays_of_assignment,
    arrays_of_rests,
    assignment_of,
    rests_of,
    updated,
)
from jmm_agent.types import Floats
from jmm_agent.updaters import AntagonismMemory, VisionMemory
from jmm_agent.vision.hold_out import HoldOutMemory
from jmm_agent.vision.observation_arrays import OPTIONAL, arrays_of, observations_of

FORMAT = "agent-memory-6"
OLDER = {
    "agent-memory-2": "which lacks the hidden layers that some rules learn; learn again",
}
"""Earlier formats, and why they are not read."""
READ = ("agent-memory-3", "agent-memory-4", "agent-memory-5")
"""Earlier formats that are read: they know nothing of misplaced joints, then of drift, or of camera
and wiring either."""
MAX_BYTES = 64 << 20
"""Largest file, unfolded [bytes]; that of the arm with 60 observations has less than one MiB."""

GENERATORS: dict[str, type[np.random.BitGenerator]] = {
    kind.__name__: kind
    for kind in (
        np.random.PCG64, np.random.PCG64DXSM, np.random.MT19937, np.random.Philox, np.random.SFC64
    )
}  # fmt: skip
"""NumPy's bit generators by the name in their state."""


class AgentMemory(NamedTuple):
    """All that an agent has learned, and what it needs to continue to the bit.

    Attributes:
        map: the map as learned.
        antagonism: what the Antagonism Updater remembers.
        vision: what the Vision Updater remembers.
        hold_out: what is remembered of held-out observations; None if none is held out.
        posture: joint angles (n,) [rad] of the last target.
        generator: state of the generator of rehearsal pairs, as a bit generator holds it.
        in_use: see `MusclesInUse.state` (m,); None: all muscles are in use.
    """

    map: JointMuscleMap
    antagonism: AntagonismMemory
    vision: VisionMemory
    hold_out: HoldOutMemory | None
    posture: Floats
    generator: dict[str, Any]
    in_use: Floats | None = None


def generator_of(state: Mapping[str, Any]) -> np.random.Generator:
    """Random generator that continues from a state.

    Args:
        state: of a bit generator of NumPy.
    """
    kind = GENERATORS[state["bit_generator"]]()
    kind.state = dict(state)
    return np.random.Generator(kind)


def write_memory(
    path: str | os.PathLike[str], memory: AgentMemory, nominal: JointMuscleMap
) -> None:
    """Write what was learned to a file, whole or not at all.

    Args:
        path: of the file; its folder is made.
        memory: to write.
        nominal: the map before learning.

    Raises:
        CheckpointError: the path is none of a file, or more of the map than layers was changed.
    """
    check_path(path)
    _check_map(memory.map, nominal)
    vision, antagonism, hold_out = memory.vision, memory.antagonism, memory.hold_out
    joints, muscles = len(nominal.joints), len(nominal.muscles)
    held_out = Pairs.none(joints, muscles) if hold_out is None else hold_out.pairs
    content: Arrays = {
        "format": np.array(FORMAT),
        "joints": np.array(nominal.joints),
        "muscles": np.array(nominal.muscles),
        "nominal_map": np.array(fingerprint(nominal)),
        "generator": np.array(json.dumps(memory.generator, default=np.ndarray.tolist)),
        **arrays_of(vision.observations, joints, muscles),
        "commands": np.array(vision.commands).reshape(-1, muscles),
        "sound": np.array(vision.sound, dtype=bool),
        "angles": vision.angles,
        "elongated": vision.elongated,
        **arrays_of_rests(vision.rests, joints, muscles),
        **arrays_of_assignment(vision.assignment, muscles),
        "last": np.empty((0, joints)) if antagonism.last is None else antagonism.last[None],
        "posture": memory.posture,
        "in_use": np.ones(muscles) if memory.in_use is None else memory.in_use,
        "counts": np.array([0, 0] if hold_out is None else hold_out[:2]),
    }
    named = (("vision", vision.pairs), ("antagonism", antagonism.pairs), ("held_out", held_out))
    for kind, pairs in named:
        content |= {f"{kind}_{part}": getattr(pairs, part) for part in Pairs._fields}
    for rank, group in enumerate(memory.map.groups):
        layers = group.layers._asdict()
        content |= {f"{name}_{rank}": layer for name, layer in layers.items()}
    write_arrays(path, content)


def read_memory(
    path: str | os.PathLike[str], nominal: JointMuscleMap, frames: Collection[str] | None = None
) -> AgentMemory:
    """Read what `write_memory` wrote.

    Args:
        path: of the file.
        nominal: the map before learning, of the agent that is to continue.
        frames: of its kinematics; None: those of the observations are not checked.

    Raises:
        CheckpointError: the file is missing, cut off or damaged, of another format, robot or
            nominal map, or an array has another shape or a number that is not finite.
    """
    check_path(path)
    try:
        content = read_arrays(path, MAX_BYTES)
        _check_robot(content, nominal)
        if _text(content, "format") in READ:
            content = updated(content, len(nominal.muscles))
        _check_arrays(content, nominal)
        _check_frames(content["frames"], frames)
        return _memory(content, nominal)
    except AgentError as error:
        reason = str(error).rstrip(".")
        raise CheckpointError(
            f"{os.fspath(path)} does not hold what this agent has learned: {reason}."
        ) from error


def _check_map(learned: JointMuscleMap, nominal: JointMuscleMap) -> None:
    """Refuse a map of which the file would not hold all that differs from the nominal map."""
    layers = {group.name: group.layers for group in learned.groups}
    if fingerprint(nominal.with_layers(layers)) != fingerprint(learned):
        raise CheckpointError(
            "What was learned cannot be kept: a memory holds the layers of the map, and the rule "
            "has changed its joints, muscles or scales, too."
        )


def check_path(path: object) -> None:
    """Refuse what is no path of a file.

    Args:
        path: of the file, which need not exist.

    Raises:
        CheckpointError: it is no path, or that of a folder.
    """
    if not isinstance(path, str | os.PathLike):
        raise CheckpointError(
            f"A memory is kept in a file; its path must be a str or a Path, got {path!r}."
        )
    if os.path.isdir(path):
        raise CheckpointError(
            f"{os.fspath(path)!r} is a folder; name the file in it that holds what was learned."
        )


def _text(content: Arrays, name: str) -> str:
    if name not in content or content[name].shape != () or content[name].dtype.kind != "U":
        raise ArrayFileError(f"it has no text {name!r}")
    return str(content[name])


def _check_robot(content: Arrays, nominal: JointMuscleMap) -> None:
    """Refuse a file of another format, other joints or muscles, or another nominal map."""
    found_format = str(content.get("format"))
    if found_format not in (FORMAT, *READ):
        why = OLDER.get(found_format, f"and {FORMAT} is read")
        raise ArrayFileError(f"its format is {found_format}, {why}")
    for kind in ("joints", "muscles"):
        found = tuple(map(str, content.get(kind, np.empty(0)).ravel()))
        own = getattr(nominal, kind)
        if found != own:
            shown = ", ".join(found[:8]) + (", ..." if len(found) > 8 else "")
            raise ArrayFileError(
                f"its {kind} ({len(found)}: {shown}) are not this robot's {len(own)} {kind}"
            )
    if _text(content, "nominal_map") != fingerprint(nominal):
        raise ArrayFileError(
            "it was learned from another nominal map, so its corrections do not fit; begin with "
            "the nominal map that it was learned from, or learn again"
        )


def _check_arrays(content: Arrays, nominal: JointMuscleMap) -> None:
    """Refuse arrays of wrong shapes and kinds, and numbers that cannot have been learned."""
    sizes = {"n": len(nominal.joints), "m": len(nominal.muscles)}
    for name, dims in SHAPES.items():
        if name not in content:
            raise ArrayFileError(f"the array {name!r} is missing")
        array = content[name]
        if array.ndim == len(dims):
            for dim, size in zip(dims, array.shape, strict=True):
                if isinstance(dim, str):
                    sizes.setdefault(dim, size)
        fits = tuple(sizes.get(dim, 0) if isinstance(dim, str) else dim for dim in dims)
        if array.shape != fits:
            raise ArrayFileError(f"{name} has shape {array.shape}, but {fits} fits")
        if array.dtype.kind not in ELEMENTS.get(name, "iuf"):
            raise ArrayFileError(f"{name} holds {array.dtype}, which does not fit")
        if array.dtype.kind in "bU":
            continue
        unknown = np.isnan(array) if name in (*OPTIONAL, *OF_MUSCLES) else False
        if not ((np.abs(array) <= LARGEST) | unknown).all():
            raise ArrayFileError(f"{name} has a number that is not finite, or beyond {LARGEST:g}")
        if (name.endswith("_noise") or name == "widths") and (array <= 0).any():
            raise ArrayFileError(f"{name} has a number that is not positive")
        if name in ("elongated", "counts", "ages", "drift", "misplaced") and (array < 0).any():
            raise ArrayFileError(f"{name} has a negative number")
    if not np.isin(content["in_use"], (0.0, 0.5, 1.0)).all() or not content["in_use"].any():
        raise ArrayFileError("in_use has a number that is not 0, 0.5 or 1, or no muscle in use")
    if sizes["L"] > 1:
        raise ArrayFileError(f"last has {sizes['L']} postures, but one fits")
    if sizes["U"] > 1:
        raise ArrayFileError(f"unbalanced has {sizes['U']} ratios, but one fits")
    if sizes["Y"] > 1:
        raise ArrayFileError(f"camera has {sizes['Y']} rows, but one fits")
    if sizes["J"] > 1:
        raise ArrayFileError(f"misplaced has {sizes['J']} rows, but one fits")
    ages = content["ages"]
    if sizes["T"] not in (0, sizes["K"]) or (np.diff(ages) > 0.0).any():
        raise ArrayFileError(
            f"ages has {sizes['T']} times, but {sizes['K']} observations have one each, the oldest "
            "first"
        )
    if sizes["Z"] > 1:
        raise ArrayFileError(f"zero has {sizes['Z']} postures, but one fits")


def _check_frames(found: NDArray[Any], frames: Collection[str] | None) -> None:
    """Refuse poses of frames that the kinematics do not have."""
    unknown = set(found.ravel().tolist()) - {"", *(frames or ())}
    if frames is not None and unknown:
        raise ArrayFileError(
            f"it has poses of {', '.join(sorted(unknown))}, which is no frame of this robot"
        )


def _memory(content: Arrays, nominal: JointMuscleMap) -> AgentMemory:
    """What the arrays of a file hold, which were checked except those of the map."""
    arrays = {name: content[name].astype(float) for name in SHAPES if name not in ELEMENTS}
    layers = {}
    for rank, group in enumerate(nominal.groups):
        names = [f"{name}_{rank}" for name in Layers._fields]
        for name in names:
            if name not in content or content[name].dtype.kind != "f":
                raise ArrayFileError(f"the array {name!r} of numbers is missing")
        layers[group.name] = Layers(*(content[name] for name in names))
    pairs = {
        kind: Pairs(*(arrays[f"{kind}_{part}"] for part in Pairs._fields))
        for kind in ("vision", "antagonism", "held_out")
    }
    vision = VisionMemory(
        observations_of(content),
        list(arrays["commands"]),
        content["sound"].tolist(),
        arrays["angles"],
        arrays["elongated"],
        pairs["vision"],
        rests=rests_of(arrays),
        assignment=assignment_of(arrays),
    )
    last = arrays["last"][0] if len(arrays["last"]) else None
    believed, in_a_row = (int(count) for count in content["counts"])
    return AgentMemory(
        nominal.with_layers(layers),
        AntagonismMemory(last, pairs["antagonism"]),
        vision,
        HoldOutMemory(believed, in_a_row, pairs["held_out"]),
        arrays["posture"],
        _generator_state(_text(content, "generator")),
        arrays["in_use"] if (arrays["in_use"] < 1.0).any() else None,
    )


def _generator_state(text: str) -> dict[str, Any]:
    """State of a random generator, which one of its kind accepts."""
    try:
        state: dict[str, Any] = json.loads(text)
        generator_of(state)
    except Exception as error:  # a state that is not accepted raises errors of many types
        raise ArrayFileError("the state of its random generator is damaged") from error
    return state
