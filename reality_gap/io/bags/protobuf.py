"""Protobuf messages: decoded by the descriptors in the bag, to dicts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reality_gap.errors import StudyError
from reality_gap.io.bags.contents import Channel


def protobuf_decoder(channel: Channel) -> Callable[[bytes], dict[str, Any]]:
    """Return a decoder of the messages of a channel.

    Args:
        channel: a channel whose definition is a FileDescriptorSet.

    Raises:
        StudyError: protobuf is not installed, or the definition is missing or damaged.
    """
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, message, message_factory
    except ImportError as error:
        raise StudyError(
            "its messages need the package protobuf: pip install 'kengoro[ros]'"
        ) from error
    files, pool = descriptor_pb2.FileDescriptorSet(), descriptor_pool.DescriptorPool()
    try:
        files.ParseFromString(channel.definition[1])
        waiting = {file.name: file for file in files.file}
        while waiting:
            ready = [f for f in waiting.values() if not waiting.keys() & set(f.dependency)]
            for file in ready or list(waiting.values()):
                pool.Add(file)
                del waiting[file.name]
        kind = pool.FindMessageTypeByName(channel.kind)
    except (message.DecodeError, KeyError, TypeError) as error:
        raise StudyError(
            f"the definition of its type {channel.kind} is missing or damaged: a FileDescriptorSet "
            "with that type was expected"
        ) from error
    factory = message_factory.GetMessageClass(kind)
    return lambda data: to_dict(factory.FromString(data))


def to_dict(message: Any) -> dict[str, Any]:
    """Return the fields of a message by name; absent messages and bytes are left out."""
    found: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        if field.type == field.TYPE_BYTES or (
            field.has_presence and not message.HasField(field.name)
        ):
            continue
        value = getattr(message, field.name)
        nested = field.message_type
        if nested is not None and nested.GetOptions().map_entry:
            holds_messages = nested.fields_by_name["value"].message_type is not None
            found[field.name] = {
                str(key): to_dict(one) if holds_messages else one for key, one in value.items()
            }
        elif hasattr(value, "DESCRIPTOR"):
            found[field.name] = to_dict(value)
        elif nested is not None:
            found[field.name] = [to_dict(one) for one in value]
        elif isinstance(value, str | bool | int | float):
            found[field.name] = value
        else:
            found[field.name] = list(value)
    return found
