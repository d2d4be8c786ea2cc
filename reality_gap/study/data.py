"""A study: the model of a machine, the commands it received, and what was measured on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Literal, NamedTuple

import mujoco
import numpy as np

from mjcf_sandbox.errors import UntrustedFileError
from mjcf_sandbox.mjcf import check_model, named_files
from reality_gap.errors import StudyError
from reality_gap.types import Floats


@dataclass(frozen=True)
class Channel:
    """One measured scalar: a component of a MuJoCo sensor, or the effort of a joint.

    Attributes:
        name: unique name in the study, shown in reports.
        sensor: name of the sensor in the model; name of the joint if ``kind`` is "effort".
        component: index into the sensor's values.
        unit: SI unit of the values: "m", "rad", "N", "N m", "m/s", "rad/s" or "1".
        noise: standard deviation of one reading [unit]; None to estimate it from the log.
        kind: "sensor", or "effort" for a joint force that inverse dynamics has to explain.
    """

    name: str
    sensor: str
    component: int = 0
    unit: str = "1"
    noise: float | None = None
    kind: Literal["sensor", "effort"] = "sensor"


@dataclass(frozen=True)
class Reading:
    """Readings of one channel in one episode.

    Attributes:
        time: when each sample was taken, shape (k,) [s].
        value: the samples, shape (k,) [unit of the channel].
    """

    time: Floats
    value: Floats


class ReadState(NamedTuple):
    """State of a joint at the begin of an episode, as its readings show it.

    Attributes:
        position: [rad or m].
        speed: velocity [rad/s or m/s].
        position_error, speed_error: standard deviations of both, in the same units.
    """

    position: float
    speed: float
    position_error: float
    speed_error: float


class Restart(NamedTuple):
    """A moment at which replays of an episode begin again; see `reality_gap.study.restarts`.

    Attributes:
        time: since the begin of the episode [s].
        states: states of joints by name; the others go on as they were.
    """

    time: float
    states: Mapping[str, ReadState]


@dataclass(frozen=True)
class Episode:
    """One uninterrupted log.

    Attributes:
        name: shown in messages and reports.
        time: when each command was given, shape (n,) [s]; starts at 0 and increases.
        command: commands in the order of the model's actuators, shape (n, nu); each is held
            until the next one.
        readings: one for each channel of the study, in its order; a channel may have fewer
            samples than there are commands, or none.
        joints: initial positions of joints [m or rad]; they override the study's ``initial``.
        log: name of the recording that the episode is a part of; empty if all episodes are parts
            of one.
        start: when the episode began, since a moment that is the same for all episodes [s]; None
            if unknown.
        states: initial states of those joints whose own readings show them.
        restarts: when replays begin again, in this order.
    """

    name: str
    time: Floats
    command: Floats
    readings: tuple[Reading, ...]
    joints: Mapping[str, float] = field(default_factory=dict)
    log: str = ""
    start: float | None = None
    states: Mapping[str, ReadState] = field(default_factory=dict)
    restarts: tuple[Restart, ...] = ()

    @property
    def duration(self) -> float:
        """Time from the first command to the last sample [s]."""
        ends = [reading.time[-1] for reading in self.readings if len(reading.time)]
        return float(max([self.time[-1], *ends]))


@dataclass(frozen=True)
class Initial:
    """Initial state of each episode.

    Attributes:
        joints: positions of joints [m or rad]; the other joints start at the model's ``qpos0``.
        settle: how long the first command is held before the log begins [s].
        restart: largest time between two moments at which replays begin again, as the readings
            show it; 0 for never, None for as often as it is needed [s].
    """

    joints: Mapping[str, float] = field(default_factory=dict)
    settle: float = 1.0
    restart: float | None = None


class JointUse(NamedTuple):
    """How a joint was used in a log.

    Attributes:
        speed: typical velocity [rad/s or m/s].
        force: typical force [N m or N].
        travel: difference of its farthest positions [rad or m]; 0 if unknown.
    """

    speed: float
    force: float
    travel: float = 0.0


@dataclass(frozen=True)
class Study:
    """Input of a diagnosis.

    Attributes:
        name: shown in reports.
        model: path of the MJCF file of the nominal model.
        channels: what was measured.
        episodes: at least one.
        initial: initial state of each episode.
        absolute_encoders: whether encoders of tendons read lengths; by default they read the
            difference to the nominal length at the model's ``qpos0``, where they are zeroed.
        uses: of joints by name, in a study whose readings were left out or have no positions.
        period: time between two readings before efforts were filtered, if they were [s].
    """

    name: str
    model: Path
    channels: tuple[Channel, ...]
    episodes: tuple[Episode, ...]
    initial: Initial = field(default_factory=Initial)
    absolute_encoders: bool = False
    uses: Mapping[str, JointUse] = field(default_factory=dict)
    period: float = 0.0

    def spec(self) -> mujoco.MjSpec:
        """Return a new copy of the model.

        Raises:
            StudyError: the model does not compile.
        """
        return load_spec(self.model).copy()

    @property
    def duration(self) -> float:
        """Sum of the durations of all episodes [s]."""
        return sum(episode.duration for episode in self.episodes)

    @property
    def states(self) -> tuple[Mapping[str, ReadState], ...]:
        """States in which replays begin, of each episode and of each of its restarts, in order."""
        return tuple(s for e in self.episodes for s in (e.states, *(r.states for r in e.restarts)))

    @property
    def restart(self) -> float:
        """Longest time between two begins of replays, 0 if no log has restarts [s]."""
        times = [[0.0, *(one.time for one in e.restarts), e.duration] for e in self.episodes]
        longest = max(float(np.diff(some).max()) for some in times)
        return longest if any(episode.restarts for episode in self.episodes) else 0.0

    @property
    def logs(self) -> tuple[str, ...]:
        """Names of the logs, each once; a log may have several episodes."""
        return tuple(dict.fromkeys(episode.log for episode in self.episodes))

    def episodes_of(self, log: str) -> tuple[int, ...]:
        """Return the indices of the episodes of a log."""
        return tuple(i for i, episode in enumerate(self.episodes) if episode.log == log)

    def elapsed(self, time: Floats) -> Floats:
        """Return the time since the first command, including pauses of the log, shape (k,) [s].

        Pauses are known if all episodes have a `start`, and none begins before another has ended.

        Args:
            time: time of the study, in which an episode begins where the one before it ended [s].
        """
        starts = [episode.start for episode in self.episodes]
        durations = np.array([episode.duration for episode in self.episodes])
        if None in starts:
            return time
        begins = np.array(starts, dtype=np.float64) - float(starts[0] or 0.0)
        if np.any(np.diff(begins) < durations[:-1] - 1e-9):
            return time
        bounds = np.concatenate([[0.0], np.cumsum(durations)])
        index = np.clip(np.searchsorted(bounds, time, side="right") - 1, 0, len(begins) - 1)
        return np.asarray(begins[index] + time - bounds[index])

    @property
    def inverse(self) -> bool:
        """Whether efforts are compared along the measured motion, by inverse dynamics."""
        return any(channel.kind == "effort" for channel in self.channels)


_stamps: dict[Path, tuple[tuple[Path, int, int], ...]] = {}
"""Of each model: its files, with the time of their last change [ns] and their size, as loaded."""


@lru_cache(maxsize=8)
def load_spec(path: Path) -> mujoco.MjSpec:
    """Load the model in ``path`` and compile it once; the result is shared, do not edit it.

    Raises:
        StudyError: there is no such file, or it does not compile.
    """
    if not path.is_file():
        raise StudyError(f"no model file at {path}")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise StudyError(f"the model {path} does not compile: {reason}") from error
    return spec


def load_untrusted_spec(path: Path, folder: Path) -> mujoco.MjSpec:
    """Check a model from an unknown source, then load it as `load_spec` does from now on.

    It is read again if one of its files has changed.

    Raises:
        StudyError: the model names files outside of ``folder``, or MuJoCo cannot load it.
    """
    check_untrusted_model(path, folder)
    files = [file for file in named_files(path, (folder,)) if file.is_file()]
    states = [(file, file.stat()) for file in files]
    stamps = tuple((file, state.st_mtime_ns, state.st_size) for file, state in states)
    if _stamps.get(path) != stamps:
        load_spec.cache_clear()
        _stamps[path] = stamps
    return load_spec(path)


def check_untrusted_model(path: Path, folder: Path) -> None:
    """Check a model from an unknown source without loading it into this process.

    Raises:
        StudyError: the model names files outside of ``folder``, or MuJoCo cannot load it.
    """
    if not path.is_file():
        raise StudyError(f"no model file at {path}")
    try:
        check_model(path, (folder,))
    except UntrustedFileError as error:
        raise StudyError(f"the model {path} {error}") from error
