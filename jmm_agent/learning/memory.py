"""What was learned, taken from the map and both updaters, and set again from a file."""

from __future__ import annotations

import os
from collections.abc import Collection

from jmm_agent.learning.job import MapLearning
from jmm_agent.mapping.joint_muscle_map import CheckpointError, JointMuscleMap
from jmm_agent.memory_file import AgentMemory, read_memory
from jmm_agent.types import Floats


def memory_of(learning: MapLearning, posture: Floats, in_use: Floats | None = None) -> AgentMemory:
    """All that was learned; later learning does not change it.

    Args:
        learning: the map and both updaters.
        posture: joint angles (n,) [rad] of the last target.
        in_use: see `MusclesInUse.state` (m,); None: all muscles are in use.
    """
    hold_out = learning.vision.hold_out
    return AgentMemory(
        learning.learner.map,
        learning.antagonism.memory,
        learning.vision.memory,
        None if hold_out is None else hold_out.memory,
        posture.copy(),
        dict(learning.learner.rng.bit_generator.state),
        in_use,
    )


def load_memory(
    path: str | os.PathLike[str],
    learning: MapLearning,
    nominal: JointMuscleMap,
    frames: Collection[str],
) -> AgentMemory:
    """Read a file of what was learned, and set the random generator and the hold-out to it.

    Args:
        path: of the file.
        learning: the map and both updaters; the map and what the updaters remember stay.
        nominal: the map before learning.
        frames: of the kinematics.

    Returns:
        What the file holds.

    Raises:
        CheckpointError: the file is missing or damaged, or does not fit; nothing is changed.
    """
    memory = read_memory(path, nominal, frames)
    try:
        learning.learner.rng.bit_generator.state = memory.generator
    except (TypeError, ValueError) as error:
        raise CheckpointError(
            f"{os.fspath(path)}: its random generator is a "
            f"{memory.generator['bit_generator']}, and this agent's is not."
        ) from error
    if learning.vision.hold_out is not None and memory.hold_out is not None:
        learning.vision.hold_out.memory = memory.hold_out
    return memory
