"""Decoders: from the bytes of a message to values with fields, for each encoding."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from reality_gap.errors import StudyError
from reality_gap.io.bags.contents import Channel
from reality_gap.io.bags.definitions import Definitions

Decoder = Callable[[bytes], Any]
"""From the bytes of a message to a dataclass, a dict, a list or a number."""

ENCODINGS = ("cdr", "ros1", "json", "protobuf")
"""Encodings of messages that can be decoded."""


def decoder(channel: Channel, definitions: Definitions, distribution: str) -> Decoder:
    """Return the decoder of a channel's messages.

    Args:
        channel: the channel.
        definitions: finds the definitions of message types.
        distribution: name of the ROS distribution that recorded the bag.

    Raises:
        StudyError: the encoding or the type of the channel is not known.
    """
    if channel.encoding == "json":
        return json.loads
    if channel.encoding == "protobuf":
        from reality_gap.io.bags.protobuf import protobuf_decoder

        return protobuf_decoder(channel)
    if channel.encoding not in ENCODINGS:
        raise StudyError(
            f"its messages are encoded as {channel.encoding!r}; valid are {', '.join(ENCODINGS)}"
        )
    if "/srv/" in channel.kind or "/action/" in channel.kind:
        raise StudyError(
            f"its messages are of the type {channel.kind}, an event of a service or an action, "
            "which holds no measurement"
        )
    stores, kind = definitions.stores(channel, distribution)
    methods = [
        s.deserialize_cdr if channel.encoding == "cdr" else s.deserialize_ros1 for s in stores
    ]
    return _first_that_fits(kind, methods)


def _first_that_fits(kind: str, methods: list[Callable[[bytes, str], Any]]) -> Decoder:
    """Return a decoder that uses the first of several by which a message can be decoded."""
    likely = list(methods)

    def decode(data: bytes) -> Any:
        for method in likely:
            try:
                found = method(data, kind)
            except Exception:  # decoders raise errors of many types
                if len(likely) == 1:
                    raise
            else:
                likely[:] = [method]
                return found
        raise StudyError(
            f"no known definition of {kind} fits; give that of the robot's ROS by --types"
        )

    return decode
