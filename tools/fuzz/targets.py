"""Targets of the fuzzer: commands that users call with files, by kind.

A target is a generator; it runs one command after the other and yields exit code and message.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

KEY = "the same"
Results = Iterator[tuple[int, str]]
RESULT = {"rms": [1.0, 2.0]}
BAGS = ("one.bag", "sqlite", "mcap/mcap.mcap")
SANDBOXED = "bag in the sandbox"


def reality_gap(*arguments: str | Path) -> tuple[int, str]:
    """Run a command of reality-gap; returns exit code and text of stderr."""
    from reality_gap.__main__ import main

    errors = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
        code = main([str(argument) for argument in arguments])
    return code, errors.getvalue().strip()


def kengoro_env(model: Path) -> tuple[int, str]:
    """Load a nominal model; returns exit code and message."""
    from kengoro_env.errors import KengoroError
    from kengoro_env.robot.nominal_model import NominalArm

    try:
        NominalArm(model)
    except KengoroError as error:
        return 2, str(error)
    return 0, ""


def check_study(folder: Path) -> Results:
    """Check a study."""
    yield reality_gap("check", folder / "STUDY.yaml")


def use_study(folder: Path, log: str) -> Results:
    """Check a study, and draft a new one from its model and log."""
    yield from check_study(folder)
    yield reality_gap("init", folder / "model.xml", folder / log, "--out", folder / "DRAFT.yaml")


def use_model(folder: Path) -> Results:
    """Use a study, and load its model for an environment."""
    yield from use_study(folder, "log.csv")
    yield kengoro_env(folder / "model.xml")


def use_checkpoints(folder: Path) -> Results:
    """Load a map, resume an experiment, and resume a diagnosis."""
    from jmm_agent.errors import AgentError
    from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
    from reality_gap.inference.checkpoint import Checkpoint

    try:
        jmm = JointMuscleMap.load(folder / "map.npz")
        jmm.lengths(np.zeros(len(jmm.joints)))
        yield 0, ""
    except AgentError as error:
        yield 2, str(error)
    with contextlib.redirect_stdout(io.StringIO()):
        _resume(folder)
    yield 0, ""
    Checkpoint(folder / "checkpoint", KEY).get(0, lambda: [np.arange(3, dtype=np.float32)])
    yield 0, ""


def _resume(folder: Path) -> None:
    from experiments.harness.runner import core_seconds, run_tasks

    run_tasks(result, {"task": ()}, 1, folder, KEY)
    core_seconds(folder, ["task"])


def result() -> dict[str, Any]:
    """Result of the task of an experiment."""
    return RESULT


def use_bags(folder: Path) -> Results:
    """Unpack each bag in this process, without the sandbox, so that it can be watched."""
    from reality_gap.errors import StudyError
    from reality_gap.io.rosbag import unpack

    for name in BAGS:
        try:
            unpack(folder / name, folder / f"{Path(name).stem}_out")
            yield 0, ""
        except StudyError as error:
            yield 2, str(error)


def unpack_bags(folder: Path) -> Results:
    """Unpack each bag with the command, which uses a sandbox."""
    for name in BAGS:
        yield reality_gap("unpack", folder / name, "--out", folder / f"{Path(name).stem}_new")


TARGETS: dict[str, Callable[[Path], Results]] = {
    "mjcf": use_model,
    "yaml": check_study,
    "csv": lambda folder: use_study(folder, "log.csv"),
    "parquet": lambda folder: use_study(folder, "log.parquet"),
    "checkpoint": use_checkpoints,
    "bag": use_bags,
    SANDBOXED: unpack_bags,
}
"""By kind: commands that use the files of a folder."""
