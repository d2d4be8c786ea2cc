"""A study: a model, what was commanded to the machine, and what was measured on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Literal

import mujoco

from mjcf_sandbox.errors import UntrustedFileError
from mjcf_sandbox.mjcf import check_model
from reality_gap.errors import StudyError
from reality_gap.types import Floats


@dataclass(frozen=True)
class Channel:
    """One measured number: a component of a MuJoCo sensor, or the effort of a joint.

    Attributes:
        name: unique in the study; people read it.
        sensor: name of the sensor in the model; of the joint if ``kind`` is "effort".
        component: index into the sensor's values.
        unit: SI unit of the values: "m", "rad", "N", "N m", "m/s", "rad/s" or "1".
        noise: standard deviation of one reading; None to estimate it from the log.
        kind: "sensor", or "effort": a joint's force that inverse dynamics is to explain.
    """

    name: str
    sensor: str
    component: int = 0
    unit: str = "1"
    noise: float | None = None
    kind: Literal["sensor", "effort"] = "sensor"


@dataclass(frozen=True)
class Reading:
    """What one channel read in one episode: ``time`` (k,) [s] and ``value`` (k,) in SI units."""

    time: Floats
    value: Floats


@dataclass(frozen=True)
class Episode:
    """One uninterrupted log.

    Attributes:
        name: for people.
        time: when each command was given (n,) [s], from 0, rising.
        command: (n, nu) in the order of the model's actuators, held until the next one.
        readings: one per channel of the study, in its order; may have fewer samples, or none.
        joints: where joints stand at the begin [m or rad], over the study's ``initial``.
    """

    name: str
    time: Floats
    command: Floats
    readings: tuple[Reading, ...]
    joints: Mapping[str, float] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """From the first command to the last sample [s]."""
        ends = [reading.time[-1] for reading in self.readings if len(reading.time)]
        return float(max([self.time[-1], *ends]))


@dataclass(frozen=True)
class Initial:
    """How every episode begins.

    Attributes:
        joints: position of joints [m or rad]; the others stand at the model's ``qpos0``.
        settle: how long the first command is held before the log begins [s].
    """

    joints: Mapping[str, float] = field(default_factory=dict)
    settle: float = 1.0


@dataclass(frozen=True)
class Study:
    """Everything a diagnosis needs.

    Attributes:
        name: for people.
        model: the MJCF file of the machine as its builders believe it to be.
        channels: what was measured.
        episodes: at least one.
        initial: how every episode begins.
    """

    name: str
    model: Path
    channels: tuple[Channel, ...]
    episodes: tuple[Episode, ...]
    initial: Initial = field(default_factory=Initial)

    def spec(self) -> mujoco.MjSpec:
        """A fresh copy of the model; `StudyError` if it does not compile."""
        return load_spec(self.model).copy()

    @property
    def duration(self) -> float:
        """Of all episodes laid end to end [s]."""
        return sum(episode.duration for episode in self.episodes)

    @property
    def inverse(self) -> bool:
        """Whether efforts are compared along the measured motion, by inverse dynamics."""
        return any(channel.kind == "effort" for channel in self.channels)


@lru_cache(maxsize=8)
def load_spec(path: Path) -> mujoco.MjSpec:
    """The model in ``path``, compiled once to see that it is valid; treat it as read-only."""
    if not path.is_file():
        raise StudyError(f"no model file at {path}")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise StudyError(f"the model {path} does not compile: {reason}") from error
    return spec


def load_strange_spec(path: Path, folder: Path) -> mujoco.MjSpec:
    """As `load_spec`, of a model that anybody may have written.

    Raises:
        StudyError: it names files outside of ``folder``, or MuJoCo does not survive it.
    """
    check_untrusted_model(path, folder)
    return load_spec(path)


def check_untrusted_model(path: Path, folder: Path) -> None:
    """Refuse what `load_strange_spec` refuses."""
    if not path.is_file():
        raise StudyError(f"no model file at {path}")
    try:
        check_model(path, (folder,))
    except UntrustedFileError as error:
        raise StudyError(f"the model {path} {error}") from error
