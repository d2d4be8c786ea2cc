"""Checkpoint of a learned agent: its map, the memory of its updaters, and its random generator."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path

import numpy as np

from experiments.harness.errors import ExperimentError
from jmm_agent.agent import Agent
from jmm_agent.mapping.learner import Pairs
from jmm_agent.updaters import AntagonismMemory, VisionMemory
from jmm_agent.vision.observation_fit import MarkerObservation
from mjcf_sandbox.files import write_bytes

FORMAT = "memory-1"


def save_checkpoint(path: Path, agent: Agent) -> None:
    """Write the learned state of an agent to ``path`` (.npz without pickle), atomically."""
    vision, antagonism = agent.vision.memory, agent.antagonism.memory
    joints, muscles = len(agent.map.joints), len(agent.map.muscles)
    generator = json.dumps(agent.learner.rng.bit_generator.state)
    content: dict[str, np.ndarray] = {
        "format": np.array(FORMAT),
        "chance": np.array(generator),
        "poses": np.array([found.pose for found in vision.observations]).reshape(-1, 4, 4),
        "lengths": np.array([found.lengths for found in vision.observations]).reshape(-1, muscles),
        "guesses": np.array([found.guess for found in vision.observations]).reshape(-1, joints),
        "commands": np.array(vision.commands).reshape(-1, muscles),
        "sound": np.array(vision.sound, dtype=bool),
        "angles": vision.angles,
        "elongated": vision.elongated,
        "last": np.empty(0) if antagonism.last is None else antagonism.last,
    }
    for name, pairs in (("vision", vision.pairs), ("antagonism", antagonism.pairs)):
        content |= {f"{name}_{part}": getattr(pairs, part) for part in Pairs._fields}
    for group in agent.map.groups:
        content |= {f"W2_{group.name}": group.W2, f"b2_{group.name}": group.b2}
    file = BytesIO()
    np.savez(file, **content)  # type: ignore[arg-type]
    write_bytes(path, file.getvalue())


def load_checkpoint(path: Path, agent: Agent) -> None:
    """Restore the learned state that `save_checkpoint` wrote.

    Args:
        path: of the file.
        agent: an agent that has learned nothing yet, of the same nominal model.

    Raises:
        ExperimentError: the file is missing, damaged or of another format.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            content = dict(file)
        if str(content["format"]) != FORMAT:
            raise ValueError(f"its format is not {FORMAT}")
        pairs = {
            name: Pairs(*(content[f"{name}_{part}"] for part in Pairs._fields))
            for name in ("vision", "antagonism")
        }
        observations = zip(content["poses"], content["lengths"], content["guesses"], strict=True)
        vision = VisionMemory(
            [MarkerObservation(*found) for found in observations],
            list(content["commands"]),
            content["sound"].tolist(),
            content["angles"],
            content["elongated"],
            pairs["vision"],
        )
        last = content["last"] if content["last"].size else None
        names = [group.name for group in agent.map.groups]
        jmm = agent.map.with_output_layers(
            {name: (content[f"W2_{name}"], content[f"b2_{name}"]) for name in names}
        )
        generator = json.loads(str(content["chance"]))
    except Exception as error:  # numpy raises many types for a damaged file
        raise ExperimentError(f"{path} is no checkpoint of an agent ({error}).") from error
    agent.recall(jmm, AntagonismMemory(last, pairs["antagonism"]), vision)
    agent.learner.rng.bit_generator.state = generator
