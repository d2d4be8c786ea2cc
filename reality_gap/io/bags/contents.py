"""Contents of a bag: channels, messages, and what is missing of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

Definition = tuple[str, bytes]
"""Encoding of the definition of a message type, such as "ros2msg", and the definition."""


class Channel(NamedTuple):
    """Messages of one topic and one type.

    Attributes:
        topic: name of the topic.
        kind: name of the message type, such as "sensor_msgs/msg/JointState".
        encoding: encoding of the messages, such as "cdr".
        definition: the type's definition; ("", b"") without one.
    """

    topic: str
    kind: str
    encoding: str
    definition: Definition = ("", b"")


class Message(NamedTuple):
    """An encoded message.

    Attributes:
        channel: the channel.
        time: when it was recorded [ns].
        data: the encoded message.
    """

    channel: Channel
    time: int
    data: bytes


@dataclass
class Contents:
    """What the readers find out about a bag while they read it.

    Attributes:
        topics: names of all topics that the bag declares.
        counted: numbers of messages by source, such as "metadata.yaml", and topic.
        read: number of messages that were read, by topic.
        faults: a sentence for each damage.
        share: fraction of the bag that has been read, 0 to 1.
        distribution: name of the ROS distribution that recorded the bag; empty if unknown.
    """

    topics: set[str] = field(default_factory=set)
    counted: dict[str, Counter[str]] = field(default_factory=dict)
    read: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    share: float = 0.0
    distribution: str = ""

    def missing(self, topic: str) -> str:
        """Return a sentence if fewer or more messages were read than the bag counts, or ""."""
        read = self.read[topic]
        for source, counts in self.counted.items():
            count = counts.get(topic, read)
            if count > read:
                return (
                    f"{topic}: {read} of the {count} messages that {source} lists were read; "
                    f"{count - read} are missing"
                )
            if count < read:
                return f"{topic}: {read} messages were read, more than the {count} in {source}"
        return ""
