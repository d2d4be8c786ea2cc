"""Clock shifts: aligns the clocks of an episode's files by a replay, and reports delays."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from mjcf_sandbox.files import write_text
from reality_gap.io.loader import load_study
from reality_gap.io.schema import StudyFile, read_study_file
from reality_gap.io.tables import read_header
from reality_gap.io.template import yaml_text
from reality_gap.simulation.clock_lags import ClockLag, clock_lag
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study

DELAY = 0.15
"""Lag above which the clocks of two files are different, because no sensor is that late [s]."""
LATE = "a delay of sensors or commands, motors that are slower than in the model"
EARLY = "servos with a velocity feed-forward, motors that are quicker than in the model"
"""Reasons why readings of the file of the commands lag behind a replay, or are ahead of it."""

Note = Callable[[str], None]
"""Called with a sentence on each lag."""


class _Part(NamedTuple):
    """Channels that one file of an episode holds.

    Attributes:
        episode: index of the episode.
        file: name of the file.
        channels: indices of the channels.
    """

    episode: int
    file: str
    channels: tuple[int, ...]


def correct_clocks(
    path: Path, guessed: Collection[str], note: Note, only: Collection[str] | None = None
) -> None:
    """Shift the clocks of readings in a drafted study that lag behind a replay of its model.

    Only files of their own are shifted, and by lags that are too long for a delay, or if their
    clock has no time in common with that of the commands. Other lags are reported.

    Args:
        path: STUDY.yaml; lines that are added say why.
        guessed: names of the files whose clock has no time in common with that of the commands.
        note: called with a sentence on each lag.
        only: names of the files to consider; by default all.
    """
    file, study = read_study_file(path), load_study(path)
    if study.inverse:
        return
    shifted = dict[tuple[int, str], tuple[float, str]]()
    with Replayer(study) as replayer:
        records = replayer.replay([]).records
        for part in _parts(file, study):
            if only is not None and part.file not in only:
                continue
            own_clock = part.file in guessed
            record = records[part.episode]
            lag = clock_lag(replayer, record, part.episode, part.channels, own_clock)
            if lag is None:
                continue
            commands = file.episodes[part.episode].names[0]
            own_file = part.file != commands
            if own_file and (own_clock or abs(lag.seconds) > DELAY):
                shift = file.episodes[part.episode].shifts.get(part.file, 0.0) - lag.seconds
                shifted[part.episode, part.file] = shift, _sentence(part.file, lag)
                note(f"corrected in {path.name}: {_sentence(part.file, lag)}; it was shifted")
            else:
                note(
                    f"{_sentence(part.file, lag)}: {LATE if lag.seconds > 0.0 else EARLY}, clocks "
                    "that differ, or another error of the model"
                )
    if shifted:
        _write(path, file, shifted)


def _sentence(name: str, lag: ClockLag) -> str:
    what = "lag behind" if lag.seconds > 0.0 else "are ahead of"
    return (
        f"the readings in {name} {what} the model's replay by {1e3 * abs(lag.seconds):.0f} ms "
        f"(correlation {lag.before:.3f}, and {lag.after:.3f} if that is corrected)"
    )


def _parts(file: StudyFile, study: Study) -> list[_Part]:
    """Return which channels each file of each episode holds."""
    columns = [column for line in file.sensors.values() for column in line.columns]
    found = []
    for e, files in enumerate(file.episodes):
        for name in files.names:
            header = set(read_header(file.locate(name), name))
            own = [c for c, column in enumerate(columns) if column in header]
            if own and len(columns) == len(study.channels):
                found.append(_Part(e, name, tuple(own)))
    return found


def _write(path: Path, file: StudyFile, shifted: dict[tuple[int, str], tuple[float, str]]) -> None:
    """Add a line with the shifts to each episode that has some."""
    text = path.read_text(encoding="utf-8").splitlines()
    for e, files in enumerate(file.episodes):
        own = {name: shift for (i, name), shift in shifted.items() if i == e}
        if not own:
            continue
        begin = text.index(f"  - commands: {yaml_text(files.names[0])}")
        values = ", ".join(f"{yaml_text(name)}: {shift:.3f}" for name, (shift, _) in own.items())
        reasons = "; ".join(reason for _, reason in own.values())
        line = f"    shifts: {{{values}}}  # {reasons}"
        end = _end_of_episode(text, begin)
        old = [i for i in range(begin, end) if text[i].startswith("    shifts:")]
        text[old[0] if old else end : old[0] + 1 if old else end] = [line]
    write_text(path, "\n".join(text) + "\n")


def _end_of_episode(text: Sequence[str], begin: int) -> int:
    """Return the number of the first line after an episode that begins in line ``begin``."""
    end = begin + 1
    while end < len(text) and text[end].startswith("    "):
        end += 1
    return end
