"""Schema: parses STUDY.yaml into files, columns and units, without opening a log."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from reprlib import repr as short

from mjcf_sandbox.errors import short_name
from reality_gap.errors import RealityGapError, StudyError
from reality_gap.io.units import Unit, parse_unit, symbols_of
from reality_gap.io.yaml_reader import Part, read_yaml
from reality_gap.types import Floats

RELATIVE, ABSOLUTE = "relative", "absolute"
"""Kinds of encoders of tendons."""

RESTART = "replays begin again in the states that readings of joints show"
LEAST_RESTART = 0.05
"""Shortest time between two restarts of replays [s]."""


@dataclass(frozen=True)
class Line:
    """One line of a study: columns of a log and how to convert their cells.

    Attributes:
        columns: one column for each component.
        unit: unit of ``scale * cell + offset`` and of ``noise``.
        scale, offset: conversion of a cell.
        noise: standard deviation of one reading [unit]; None if unknown.
    """

    columns: tuple[str, ...]
    unit: Unit
    scale: float = 1.0
    offset: float = 0.0
    noise: float | None = None

    def in_si(self, cells: Floats) -> Floats:
        """Convert cells of any shape to SI units."""
        return self.unit.factor * (self.scale * cells + self.offset)

    @property
    def noise_in_si(self) -> float | None:
        """Standard deviation of one reading in SI units; None if unknown."""
        return None if self.noise is None else self.noise * self.unit.factor


@dataclass(frozen=True)
class Files:
    """Logs of one episode.

    Attributes:
        names: file names relative to the study, the one with the commands first.
        joints: initial positions of joints [rad or m]; they override those of the study.
        log: name of the recording that the episode is a part of; empty if it has none.
        start: when the episode began [s]; None for the first time of its commands.
        shifts: what is added to the times of a file, by file name [s].
    """

    names: tuple[str, ...]
    joints: dict[str, float]
    log: str = ""
    start: float | None = None
    shifts: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class StudyFile:
    """Content of STUDY.yaml.

    Attributes:
        path: path of STUDY.yaml.
        name: name of the study, shown in reports.
        model: path of the MJCF file, inside the study's folder.
        episodes: at least one.
        time: the column of the time in all logs.
        actuators, sensors, efforts: lines by name of the actuator, sensor or joint.
        joints: initial positions [rad or m]; None to take the first reading of each joint.
        settle: how long the first command is held before the log begins [s].
        restart: largest time between two restarts of replays; None for as often as needed [s].
        absolute_encoders: whether encoders of tendons are absolute.
    """

    path: Path
    name: str
    model: Path
    episodes: tuple[Files, ...]
    time: Line
    actuators: dict[str, Line]
    sensors: dict[str, Line]
    efforts: dict[str, Line]
    joints: dict[str, float] | None
    settle: float
    restart: float | None = None
    absolute_encoders: bool = False

    def locate(self, name: str) -> Path:
        """Return the path of a file that the study names; see `locate`."""
        return locate(self.path, name)


def locate(study: Path, name: str) -> Path:
    """Return the path of a file that a study names.

    Args:
        study: path of STUDY.yaml.
        name: file name as written in the study.

    Raises:
        StudyError: the file lies outside of the study's folder, or the name is not a path.
    """
    folder = study.parent.resolve()
    try:
        path = (folder / name).resolve()
        path.is_file()  # raises OSError if the name is too long
    except (OSError, RuntimeError, ValueError) as error:
        raise StudyError(f"{study}: {short_name(name)!r} is not a path of a file") from error
    if Path(name).is_absolute() or not path.is_relative_to(folder):
        raise StudyError(
            f"{study}: {short_name(name)!r} lies outside the study's folder; copy it there and "
            "give its path relative to the study"
        )
    return path


def read_study_file(path: Path) -> StudyFile:
    """Read STUDY.yaml.

    Raises:
        StudyError: a key or value is wrong; the message names the key and the valid values.
    """
    top = read_yaml(path)
    top.only(
        *("name", "model", "episodes", "time", "actuators", "sensors", "efforts", "initial"),
        "encoders",
    )
    actuators, sensors, efforts = (
        {name: _line(part) for name, part in top.parts(key).items()}
        for key in ("actuators", "sensors", "efforts")
    )
    if actuators and efforts:
        raise StudyError(f"{path} has both actuators and efforts; give only one of them")
    if not sensors and not efforts:
        raise StudyError(f"{path} has no measurements; give at least one line under sensors")
    joints, settle, restart = _initial(top)
    if restart and not actuators:
        raise StudyError(f"{path}, initial.restart: {RESTART}; efforts are not replayed")
    return StudyFile(
        path=path,
        name=top.text("name", path.stem),
        model=locate(path, top.text("model")),
        episodes=_episodes(top),
        time=_time(top),
        actuators=actuators,
        sensors=sensors,
        efforts=efforts,
        joints=joints,
        settle=settle,
        restart=restart,
        absolute_encoders=_encoders(top),
    )


def _encoders(top: Part) -> bool:
    """Return whether encoders of tendons are absolute."""
    kind = top.text("encoders", RELATIVE)
    if kind not in (RELATIVE, ABSOLUTE):
        raise top.fault(f"encoders must be {RELATIVE} or {ABSOLUTE}, not {short(kind)}")
    return kind == ABSOLUTE


def _line(part: Part) -> Line:
    part.only("column", "columns", "unit", "scale", "offset", "noise")
    given = part.items()
    if ("column" in given) == ("columns" in given):
        raise part.fault("give either column: NAME or columns: [NAME, NAME, ...]")
    columns = part.texts("columns") if "columns" in given else (part.text("column"),)
    if len(set(columns)) != len(columns) or not columns:
        raise part.fault(f"columns must be different names, not {short(list(columns))}")
    scale = part.number("scale", 1.0)
    if scale == 0.0:
        raise part.fault("scale must not be 0; leave it out for 1")
    noise = part.number("noise", 1.0) if given.get("noise") is not None else None
    if noise is not None and noise < 0.0:
        raise part.fault(
            "noise must not be negative; 0 is for computed values, and without it, it is "
            "estimated from the log"
        )
    return Line(columns, _unit(part), scale, part.number("offset", 0.0), noise)


def _unit(part: Part) -> Unit:
    text = part.text("unit")
    try:
        return parse_unit(text)
    except RealityGapError as error:
        raise part.fault(str(error)) from error


def _time(top: Part) -> Line:
    part = top.part("time")
    if part.value is None:
        raise top.fault("the key 'time' is missing; an example is time: {column: time, unit: s}")
    part.only("column", "unit")
    line = _line(part)
    if line.unit.si != "s":
        valid = ", ".join(symbols_of("s"))
        raise part.fault(f"{line.unit.symbol} is not a unit of time; valid are {valid}")
    return line


def _episodes(top: Part) -> tuple[Files, ...]:
    part = top.part("episodes")
    if not isinstance(part.value, list) or not part.value:
        raise top.fault(
            "'episodes' must be a list of at least one episode; an example is episodes: "
            "[{commands: log.csv}]"
        )
    episodes = []
    for i, item in enumerate(part.value):
        episode = Part(top.path, f"episodes[{i}]", item)
        episode.only("commands", "readings", "joints", "log", "start", "shifts")
        names = (episode.text("commands"), *episode.texts("readings"))
        given = episode.items()
        start = episode.number("start", 0.0) if given.get("start") is not None else None
        episodes.append(
            Files(names, _joints(episode), episode.text("log", ""), start, _shifts(episode, names))
        )
    every = [name for episode in episodes for name in episode.names]
    for name in every:
        if every.count(name) > 1:
            raise part.fault(f"{name} is named twice; a log belongs to one episode only")
    return tuple(episodes)


def _shifts(episode: Part, names: tuple[str, ...]) -> dict[str, float]:
    shifts = {name: part.as_number() for name, part in episode.parts("shifts").items()}
    for name in shifts:
        if name not in names[1:]:
            known = ", ".join(names[1:]) or "none"
            raise episode.fault(
                f"shifts are for files in readings, whose times are shifted against those of the "
                f"commands; {short(name)} is none of them: {known}"
            )
    return shifts


def _initial(top: Part) -> tuple[dict[str, float] | None, float, float | None]:
    part = top.part("initial")
    if part.value is None:
        return {}, 1.0, None
    part.only("joints", "settle", "restart")
    settle, read = part.number("settle", 1.0), part.part("joints").value == "first_reading"
    if settle < 0.0:
        raise part.fault(f"settle must be a time in seconds, 0 or more, not {settle:g}")
    restart = None
    if part.part("restart").value is not None:
        restart = part.number("restart", 0.0)
        if restart != 0.0 and restart < LEAST_RESTART:
            raise part.fault(
                f"restart must be a time in seconds from {LEAST_RESTART:g} on, or 0 for none, not "
                f"{restart:g}"
            )
        if restart and not read:
            raise part.fault(f"restart needs 'joints: first_reading'; {RESTART}")
    return (None if read else _joints(part)), settle, restart


def _joints(part: Part) -> dict[str, float]:
    return {name: joint.as_number() for name, joint in part.parts("joints").items()}
