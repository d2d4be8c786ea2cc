"""Definitions of ROS messages: embedded in a bag, of a ROS distribution, or given as files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)

from reality_gap.errors import StudyError
from reality_gap.io.bags.contents import Channel

LARGEST = 1 << 20
"""Largest size of a file with a definition [bytes]."""
_IDL_HEADING = "=" * 80 + "\nIDL: "
_PARSER_ERRORS = (
    *(AssertionError, LookupError, RecursionError, SyntaxError),
    *(TypeError, TypesysError, ValueError),
)


class Definitions:
    """Finds the definition of message types.

    Args:
        folder: folder of .msg and .idl files; None: none is given.

    Raises:
        StudyError: a file of the folder cannot be read.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._given = {} if folder is None else _given(folder)
        self._stores: dict[tuple[Any, ...], Any] = {}

    def stores(self, channel: Channel, distribution: str) -> tuple[list[Any], str]:
        """Return stores of types that hold the type of a channel, and the type's name in them.

        Without a definition in the bag these are the definitions of ROS distributions, the most
        likely one first.

        Args:
            channel: the channel.
            distribution: name of the ROS distribution that recorded the bag.

        Raises:
            StudyError: the type is not known, or its definition is wrong.
        """
        kind = full_name(channel.kind)
        key = (kind, channel.encoding, channel.definition, distribution)
        if key not in self._stores:
            self._stores[key] = self._find(kind, channel, distribution)
        return self._stores[key], kind

    def _find(self, kind: str, channel: Channel, distribution: str) -> list[Any]:
        fault = "the bag holds no definition of it"
        format_, text = channel.definition
        if format_:
            try:
                types = _parse(kind, format_, text.decode("utf-8"))
                if kind in types:
                    store = _store(types, Stores.EMPTY)
                    if not missing(store, kind):
                        return [store]
                    types = {**_known(channel, distribution), **self._given, **types}
                    store = _store(types, Stores.EMPTY)
                    if not (absent := missing(store, kind)):
                        return [store]
                    fault = f"its definition in the bag needs {absent}, which is not there"
                else:
                    fault = "its definition in the bag is one of another type"
            except _PARSER_ERRORS as error:
                fault = f"its definition in the bag cannot be read ({reason(error)})"
        types = {**_known(channel, distribution), **self._given}
        store = _store(types, Stores.EMPTY)
        if kind in types and not (absent := missing(store, kind)):
            others = [] if kind in self._given else _other_distributions(channel, kind)
            return [store, *others]
        if kind in types:
            raise StudyError(
                f"its type {kind} needs {absent}, which is not known; add its .msg file to --types"
            )
        raise StudyError(
            f"its type {kind} is not known, and {fault}; give a folder with its .msg or .idl file "
            "by --types"
        )


def full_name(kind: str) -> str:
    """Return the name of a type with its middle part, as in "std_msgs/msg/Header"."""
    return kind.replace("/", "/msg/") if kind.count("/") == 1 else kind.replace("::", "/")


def reason(error: Exception) -> str:
    """Return what an error of a library says, in words."""
    text = " ".join(str(error).split())
    if isinstance(error, KeyError) or not text:
        return f"{type(error).__name__} {text}".strip()
    return text if len(text) < 200 else f"{text[:200]} ..."


def missing(store: Any, kind: str) -> str:
    """Return the name of a type that ``kind`` consists of but that is not in a store, or ""."""
    seen, waiting = {kind}, [kind]
    while waiting:
        one = waiting.pop()
        if one not in store.fielddefs:
            return one
        for _, description in store.fielddefs[one][1]:
            node, details = description
            while node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
                node, details = details[0]
            if node is Nodetype.NAME and details not in seen:
                seen.add(details)
                waiting.append(details)
    return ""


def _store(types: Any, base: Stores) -> Any:
    store = get_typestore(base)
    store.register(types)
    return store


def _known(channel: Channel, distribution: str) -> Any:
    """Return the types that a ROS distribution brings."""
    if channel.encoding == "ros1":
        return get_typestore(Stores.ROS1_NOETIC).fielddefs
    name = f"ROS2_{distribution.upper()}"
    return get_typestore(Stores.__members__.get(name, Stores.LATEST)).fielddefs


def _other_distributions(channel: Channel, kind: str) -> list[Any]:
    """Return stores of all ROS 2 distributions with a type; its definition differs in some."""
    if channel.encoding == "ros1":
        return []
    stores = [get_typestore(s) for n, s in Stores.__members__.items() if n.startswith("ROS2")]
    return [store for store in stores if kind in store.fielddefs]


def _parse(kind: str, format_: str, text: str) -> dict[str, Any]:
    """Return the types in a definition, which holds those that it consists of."""
    if format_ in ("ros2msg", "ros1msg"):
        return dict(get_types_from_msg(text, kind))
    if format_ not in ("ros2idl", "omgidl"):
        raise ValueError(f"it is in the format {format_!r}; valid are ros2msg, ros2idl, ros1msg")
    if not text.startswith(_IDL_HEADING):
        return dict(get_types_from_idl(text))
    types: dict[str, Any] = {}
    for part in text.split(_IDL_HEADING)[1:]:
        types |= get_types_from_idl(part.partition("\n")[2].removesuffix("=" * 80 + "\n"))
    return types


def _given(folder: Path) -> dict[str, Any]:
    """Return the types in the .msg and .idl files of a folder."""
    if not folder.is_dir():
        raise StudyError(f"there is no folder {folder}, which --types names")
    types: dict[str, Any] = {}
    root = folder.resolve()
    for path in sorted(p for p in root.rglob("*") if p.suffix in (".msg", ".idl")):
        if not path.resolve().is_relative_to(root) or path.stat().st_size > LARGEST:
            raise StudyError(
                f"{path} is a link out of {folder}, or larger than {LARGEST >> 20} MiB; it is no "
                "definition of a message"
            )
        try:
            text = path.read_text("utf-8")
            package = path.parents[1] if path.parent.name == "msg" else path.parent
            kind = f"{package.name}/msg/{path.stem}"
            found = get_types_from_msg(text, kind) if path.suffix == ".msg" else None
            types |= get_types_from_idl(text) if found is None else found
        except _PARSER_ERRORS as error:
            raise StudyError(f"{path} is no definition of a message: {reason(error)}") from error
    if not types:
        raise StudyError(f"{folder}, which --types names, holds no .msg or .idl file")
    return types
