"""YAML reader: each error names the file, the key and the valid values in one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from reprlib import repr as short

import yaml

from reality_gap.errors import StudyError
from reality_gap.io.cells import LARGEST

MAX_BYTES = 1 << 20
"""Largest file [bytes]."""


def nearest(name: str, known: tuple[str, ...]) -> str:
    """Join the ``known`` names for a message, the ones most similar to ``name`` first."""
    first = get_close_matches(name, known, n=3, cutoff=0.5)
    rest = [other for other in known if other not in first]
    return ", ".join([*first, *rest]) or "none"


def read_yaml(path: Path) -> Part:
    """Read a YAML file.

    Raises:
        StudyError: the file is missing, too large, or not valid YAML.
    """
    return Part(path, "", _parse(path))


@dataclass(frozen=True)
class Part:
    """A value in a YAML file.

    Attributes:
        path: path of the file.
        where: key of the value, such as "sensors.length_biceps"; empty for the whole file.
        value: the value as PyYAML loads it.
    """

    path: Path
    where: str
    value: object

    def fault(self, text: str) -> StudyError:
        """Return an error whose message begins with file and key."""
        return StudyError(f"{self.path}{', ' * bool(self.where)}{self.where}: {text}")

    def items(self) -> dict[str, object]:
        """Return the values by key; the value must be a mapping and its keys must be names."""
        if not isinstance(self.value, Mapping):
            raise self.fault(f"keys and values are expected, not {short(self.value)}")
        for key in self.value:
            if isinstance(key, bool) or not isinstance(key, str | int):
                raise self.fault(f"the key {short(key)} is not a name; put it in quotes")
        return {str(key): value for key, value in self.value.items()}

    def only(self, *known: str) -> None:
        """Raise an error for keys that are not ``known``."""
        for key in self.items():
            if key not in known:
                raise self.fault(f"unknown key {short(key)}; known: {nearest(key, known)}")

    def part(self, key: str) -> Part:
        """Return the part under a key; its value is None if the key is missing."""
        where = f"{self.where}.{key}" if self.where else key
        return Part(self.path, where, self.items().get(key))

    def parts(self, key: str) -> dict[str, Part]:
        """Return the parts of the mapping under a key; empty if the key is missing."""
        part = self.part(key)
        return {} if part.value is None else {name: part.part(name) for name in part.items()}

    def text(self, key: str, default: str | None = None) -> str:
        """Return the text under a key; without a default the key must exist."""
        value = self.part(key).value
        if value is None and default is not None:
            return default
        if value is None:
            raise self.fault(f"the key {key!r} is missing")
        return self.part(key).as_text()

    def as_text(self) -> str:
        """Return this value as a name."""
        if isinstance(self.value, bool) or not isinstance(self.value, str | int | float):
            raise self.fault(f"a name is expected, not {short(self.value)}; put it in quotes")
        return str(self.value)

    def number(self, key: str, default: float) -> float:
        """Return the number under a key."""
        value = self.part(key).value
        if value is None:
            return default
        return self.part(key).as_number()

    def as_number(self) -> float:
        """Return this value as a number; its magnitude must be at most `LARGEST`."""
        # YAML 1.1 loads 1e-4, without a decimal point, as text.
        if isinstance(self.value, str | int | float) and not isinstance(self.value, bool):
            try:
                number = float(self.value)
            except (ValueError, OverflowError):
                number = float("nan")
            if abs(number) <= LARGEST:
                return number
            if abs(number) > LARGEST:
                raise self.fault(f"{short(self.value)} is larger than {LARGEST:g}")
        raise self.fault(f"a number is expected, not {short(self.value)}")

    def texts(self, key: str) -> tuple[str, ...]:
        """Return the list of names under a key; empty if the key is missing."""
        part = self.part(key)
        if part.value is None:
            return ()
        if not isinstance(part.value, list):
            raise part.fault(f"a list is expected, such as [a, b], not {short(part.value)}")
        return tuple(
            Part(self.path, f"{part.where}[{i}]", item).as_text()
            for i, item in enumerate(part.value)
        )


def _parse(path: Path) -> object:
    if not path.is_file():
        raise StudyError(f"there is no study file at {path}")
    if path.stat().st_size > MAX_BYTES:
        raise StudyError(f"{path} is larger than {MAX_BYTES >> 20} MiB, too large for a study")
    try:
        text = path.read_text(encoding="utf-8")
        _refuse_repeated_keys(path, yaml.compose(text, Loader=yaml.SafeLoader))
        return yaml.safe_load(text)
    except StudyError:
        raise
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        reason = " ".join(str(error).split()) or "nested too deeply"
        raise StudyError(f"{path} is not valid YAML: {reason}") from error
    except (LookupError, AttributeError) as error:  # raised by PyYAML for !!bool and !!timestamp
        raise StudyError(f"{path} is not valid YAML: a value does not fit its tag") from error


def _refuse_repeated_keys(path: Path, root: yaml.Node | None) -> None:
    """Raise an error for repeated keys, of which PyYAML silently keeps the last one."""
    waiting, seen = [root], set()
    while waiting:
        node = waiting.pop()
        if node is None or id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            waiting += node.value
        if isinstance(node, yaml.MappingNode):
            keys: set[str] = set()
            for key, _ in node.value:
                if isinstance(key, yaml.ScalarNode) and key.value in keys:
                    line = key.start_mark.line + 1
                    raise StudyError(f"{path}, line {line}: {key.value!r} is given twice")
                keys.add(str(key.value))
            waiting += [value for _, value in node.value]
