"""Extension of griffe: our docstrings as the reference of the site can show them.

Docstrings are written for who reads the code; Markdown would take some of it for its own.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension  # type: ignore[import-not-found,unused-ignore]

SEVERAL = re.compile(
    r"^(?P<indent> +)(?P<names>\w+(?:, \w+)+)(?P<text>:.*(?:\n(?P=indent) +.*)*)", re.MULTILINE
)
"""``low, high: bounds.``, with the lines that go on from there."""

TABLE = re.compile(r"^=+ [ =]+\n(?:.+(?:\n|$))+", re.MULTILINE)
"""A table of reStructuredText."""


def readable(text: str) -> str:
    """The docstring with one entry a name, tables as they stand, and no link but those meant."""

    def one_each(found: re.Match[str]) -> str:
        names = found["names"].split(", ")
        return "\n".join(f"{found['indent']}{name}{found['text']}" for name in names)

    text = SEVERAL.sub(one_each, text)
    text = TABLE.sub(lambda found: f"```text\n{found[0].rstrip()}\n```\n", text)
    text = re.sub(r"\] \[", r"] \\[", text)  # "[-1, 1] [rad]" is a link in Markdown
    return re.sub(r"::$", ":", text, flags=re.MULTILINE)


class Readable(Extension):  # type: ignore[misc,unused-ignore]
    """Rewrites every docstring before it is parsed."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Called by griffe for each module, class, function and attribute."""
        if obj.docstring is not None:
            obj.docstring.value = readable(obj.docstring.value)
