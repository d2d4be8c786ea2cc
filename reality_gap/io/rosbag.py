"""Bags: converts ROS 1 and ROS 2 bags and MCAP files to CSV files that a study can use.

Each topic becomes a file, because each topic has its own times. Each topic is read separately: what
cannot be read is left out with a sentence. Text, images and point clouds are left out. Needs the
packages of the extra ``ros``: ``pip install 'kengoro[ros]'``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.io.bags.contents import Contents
from reality_gap.io.new_folder import check_new, new_folder

if TYPE_CHECKING:
    from reality_gap.io.bags.reading import Bag


def unpack(
    bag: Path,
    out: Path,
    topics: Sequence[str] = (),
    by_arrival: bool = False,
    progress: Callable[[float], None] = lambda share: None,
    *,
    types: Path | None = None,
    note: Callable[[str], None] = lambda sentence: None,
) -> tuple[Path, ...]:
    """Write a bag's topics as CSV files into a new folder, all of them or none.

    Each file has a column ``time`` [s], which is 0 at the earliest message of all files. The
    other columns are named after topic and field, and after the joint or the frames if the message
    names them, as in ``joint_states_position_elbow``. Units are those of the bag (SI in ROS).

    Args:
        bag: a .bag file, the folder of a ROS 2 bag, or an .mcap or .db3 file.
        out: folder to create.
        topics: topics to write; by default all that hold numbers.
        by_arrival: use the time at which messages were recorded instead of their time stamps.
        progress: called with the fraction of the bag that has been read, 0 to 1.
        types: folder of .msg and .idl files with definitions of messages.
        note: called with a sentence for each thing that was left out or is missing.

    Returns:
        The files, in the order of the topics' names.

    Raises:
        StudyError: the bag cannot be read, holds no numbers, or ``out`` exists.
        UnknownNameError: the bag has no such topic.
    """
    check_new(out)
    read = read_bag(bag, topics, progress, types)
    from reality_gap.io.bags.reading import clock_notes, order_notes

    found = read.topics
    if not found:
        why = "; ".join(read.notes[:5])
        raise StudyError(f"{bag.name} has no message that contains a number{why and ': '}{why}")
    stems = [topic.stem for topic in found]
    if len(set(stems)) < len(stems):
        twice = next(stem for stem in stems if stems.count(stem) > 1)
        raise StudyError(f"two topics of {bag.name} would both be {twice}.csv; choose one of them")
    clocks = (*clock_notes(found, by_arrival), *order_notes(found, by_arrival))
    for sentence in (*read.notes, *clocks):
        note(sentence)
    start = min(int(topic.time(by_arrival).min()) for topic in found)
    with new_folder(out) as folder:
        for topic in found:
            topic.write(folder / f"{topic.stem}.csv", start, by_arrival)
    return tuple(out.resolve() / f"{stem}.csv" for stem in stems)


def read_bag(
    bag: Path,
    topics: Sequence[str] = (),
    progress: Callable[[float], None] = lambda share: None,
    types: Path | None = None,
) -> Bag:
    """Read all numbers in the messages of a bag.

    Args and errors are those of `unpack`.
    """
    try:
        from reality_gap.io.bags.definitions import Definitions
        from reality_gap.io.bags.files import messages
        from reality_gap.io.bags.reading import Reading
    except ImportError as error:
        raise StudyError(
            "reading bags needs the package rosbags: pip install 'kengoro[ros]'"
        ) from error
    if not bag.exists():
        raise StudyError(f"there is no bag {bag}")
    contents = Contents()
    reading = Reading(Definitions(types), contents)
    for i, message in enumerate(messages(bag, contents)):
        if not topics or message.channel.topic in topics:
            reading.take(message)
        if i % 100 == 0:
            progress(min(contents.share, 1.0))
    if contents.faults and not contents.topics:
        raise StudyError(f"{bag.name} cannot be read as a bag: {'; '.join(contents.faults)}")
    for name in topics:
        if name not in contents.topics:
            raise UnknownNameError("topic", name, sorted(contents.topics))
    return reading.result(topics)
