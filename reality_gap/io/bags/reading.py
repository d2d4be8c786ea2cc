"""Reading of a bag's messages, each topic separately, with a sentence for what is left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from reality_gap.errors import StudyError
from reality_gap.io.bags.contents import Channel, Contents, Message
from reality_gap.io.bags.decoders import Decoder, decoder
from reality_gap.io.bags.definitions import Definitions, reason
from reality_gap.io.bags.topic import MAX_IDENTITIES, Topic
from reality_gap.io.bags.values import Path, Reader

FAR = 60 * 10**9
"""Distance between the times of two topics above which they are on different clocks [ns]."""
HOPELESS = 100
"""Number of messages of a topic that cannot be decoded after which, without any that can be, the
others are not tried."""
SHOWN = 5
"""Largest number of columns that a note names."""


class Bag(NamedTuple):
    """What was read of a bag.

    Attributes:
        topics: topics with numbers, in the order of their names.
        notes: a sentence for each thing that was left out or is missing.
    """

    topics: tuple[Topic, ...]
    notes: tuple[str, ...]


class Reading:
    """Takes in the messages of a bag one after another.

    Args:
        definitions: finds the definitions of message types.
        contents: what the readers find out about the bag.
    """

    def __init__(self, definitions: Definitions, contents: Contents) -> None:
        self._definitions, self._contents = definitions, contents
        self._decoders: dict[Channel, Decoder | None] = {}
        self._topics: dict[str, Topic] = {}
        self._readers: dict[str, Reader] = {}
        self._left_out: dict[str, str] = {}
        self._failed: Counter[str] = Counter()
        self._reasons: dict[str, str] = {}

    def take(self, message: Message) -> None:
        """Take in a message."""
        channel, time, data = message
        if channel not in self._decoders:
            self._decoders[channel] = self._decoder(channel)
        decode = self._decoders[channel]
        if decode is None:
            return
        topic = self._topics.setdefault(channel.topic, Topic(channel.topic))
        reader = self._readers.setdefault(channel.topic, Reader())
        if self._failed[channel.topic] >= HOPELESS and not topic.rows:
            self._failed[channel.topic] += 1
            return
        try:
            for entry in reader.entries(decode(data)):
                topic.add(time, entry)
        except MemoryError:
            raise
        except Exception as error:  # on damaged messages the decoders raise errors of any type
            self._failed[channel.topic] += 1
            self._reasons.setdefault(channel.topic, reason(error))

    def result(self, chosen: Sequence[str]) -> Bag:
        """Return what was read.

        Args:
            chosen: names of the topics to read; empty: all.
        """
        names = sorted(n for n in self._contents.topics if not chosen or n in chosen)
        found = tuple(t for n in names if (t := self._topics.get(n)) is not None and not t.empty)
        notes = list(self._contents.faults)
        for name in names:
            notes += self._notes(name)
        silent = [
            name
            for name in names
            if name in self._topics
            and self._topics[name].empty
            and self._failed[name] < self._contents.read[name]
        ]
        if silent:
            notes.append(f"left out, as their messages hold no numbers: {', '.join(silent)}")
        return Bag(found, tuple(notes))

    def _decoder(self, channel: Channel) -> Decoder | None:
        try:
            return decoder(channel, self._definitions, self._contents.distribution)
        except StudyError as error:
            self._left_out.setdefault(channel.topic, str(error))
            return None

    def _notes(self, name: str) -> list[str]:
        """Return the sentences about a topic."""
        notes = []
        if name in self._left_out:
            notes.append(f"{name} is left out: {self._left_out[name]}")
        if missing := self._contents.missing(name):
            notes.append(missing)
        if failed := self._failed[name]:
            notes.append(
                f"{name}: {failed} of {self._contents.read[name]} messages cannot be decoded and "
                f"are left out ({self._reasons[name]})"
            )
        topic = self._topics.get(name)
        if topic is None or topic.empty:
            return notes
        if topic.identities > MAX_IDENTITIES:
            notes.append(
                f"{name}: its messages are about {topic.identities} different things, more than "
                f"{MAX_IDENTITIES}; its columns mix them"
            )
        notes += [
            f"{name}: more than one column would be {c}; they are numbered"
            for c in topic.labels()[1]
        ]
        if 0 < topic.unstamped < topic.rows:
            notes.append(
                f"{name}: {topic.unstamped} of {topic.rows} messages have no time stamp, so that "
                "the times of arrival are used for all"
            )
        return notes + _array_notes(name, self._readers[name]) + _gap_notes(topic)


def _array_notes(name: str, reader: Reader) -> list[str]:
    """Return sentences on arrays of a topic whose elements have no names."""
    notes = [
        f"{name}: {_shown(path)} has {elements} elements, but the message lists {names} names; its "
        "columns are numbered"
        for path, (names, elements) in reader.misfits.items()
    ]
    notes += [
        f"{name}: the elements of {_shown(path)} have no names, and there are {low} to {high} of "
        "them; the columns follow their order in each message"
        for path, (low, high) in reader.counts.items()
        if low < high
    ]
    return notes


def _shown(path: Path) -> str:
    return ".".join(path) or "the message"


def _gap_notes(topic: Topic) -> list[str]:
    """Return a sentence if numbers of a topic are not finite."""
    count, empty = topic.not_finite()
    if not count:
        return []
    columns = ", ".join(empty[:SHOWN]) + (f" and {len(empty) - SHOWN} more" * (len(empty) > SHOWN))
    where = f"; no number is left in {columns}" if empty else ""
    return [f"{topic.name}: {count} numbers are NaN or infinite; their cells are empty{where}"]


def order_notes(topics: Sequence[Topic], by_arrival: bool) -> list[str]:
    """Return sentences on topics whose times go back, or are those of several messages."""
    notes = []
    for topic in topics:
        order = topic.order(by_arrival)
        if order.steps_back:
            notes.append(
                f"the times of {topic.name} go back {order.steps_back} times, by up to "
                f"{1e-9 * order.longest:.6g} s; the rows are sorted by time"
                + ("" if by_arrival else "; --arrival uses the times of recording instead")
            )
        if order.overwritten:
            notes.append(
                f"{order.overwritten} messages of {topic.name} were overwritten by later ones of "
                "the same time"
            )
    return notes


def clock_notes(topics: Sequence[Topic], by_arrival: bool) -> list[str]:
    """Return a sentence if the times of topics are on different clocks."""
    spans = []
    for topic in topics:
        time = topic.time(by_arrival)
        spans.append((int(time.min()), int(time.max()), topic.name))
    first, last = min(spans, key=lambda s: s[1]), max(spans)
    if by_arrival or last[0] - first[1] <= FAR:
        return []
    return [
        f"the times of {last[2]} begin {1e-9 * (last[0] - first[1]):.6g} s after those of "
        f"{first[2]} end: their stamps are of different clocks; use --arrival"
    ]
