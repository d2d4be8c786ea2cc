"""Extension of griffe: converts docstrings to the Markdown of the reference pages.

Docstrings are written for readers of the code; Markdown would misread some of their characters.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension  # type: ignore[import-not-found,unused-ignore]

SEVERAL = re.compile(
    r"^(?P<indent> +)(?P<names>\w+(?:, \w+)+)(?P<text>:.*(?:\n(?P=indent) +.*)*)", re.MULTILINE
)
"""An entry of several names, ``low, high: bounds.``, with its continuation lines."""

TABLE = re.compile(r"^=+ [ =]+\n(?:.+(?:\n|$))+", re.MULTILINE)
"""A table of reStructuredText."""


def readable(text: str) -> str:
    """Convert a docstring: one entry for each name, tables as code, no accidental links.

    Args:
        text: docstring.
    """

    def one_each(found: re.Match[str]) -> str:
        names = found["names"].split(", ")
        return "\n".join(f"{found['indent']}{name}{found['text']}" for name in names)

    text = SEVERAL.sub(one_each, text)
    text = TABLE.sub(lambda found: f"```text\n{found[0].rstrip()}\n```\n", text)
    text = re.sub(r"\] \[", r"] \\[", text)  # Markdown reads "[-1, 1] [rad]" as a link
    return re.sub(r"::$", ":", text, flags=re.MULTILINE)


class Readable(Extension):  # type: ignore[misc,unused-ignore]
    """Converts every docstring before griffe parses it."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Convert the docstring of a module, class, function or attribute; griffe calls it."""
        if obj.docstring is not None:
            obj.docstring.value = readable(obj.docstring.value)
