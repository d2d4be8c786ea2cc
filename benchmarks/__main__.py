"""Command line: `python -m benchmarks NAME [NAME ...]`; without a name it lists the benchmarks.

Options after a single name are those of that benchmark: `python -m benchmarks NAME --help`.
"""

from __future__ import annotations

import ast
import importlib
import sys
from itertools import takewhile
from pathlib import Path

OPTIONS = {"agent_step"}
"""Benchmarks that take options."""

FOLDER = Path(__file__).resolve().parent


def names() -> list[str]:
    """Names of the benchmarks: modules of this folder without an underscore in front."""
    return sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))


def summary(name: str) -> str:
    """First line of the benchmark's docstring, read without importing it."""
    docstring = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8")))
    return (docstring or "").partition("\n")[0]


def main(arguments: list[str]) -> int:
    """Run the named benchmarks in order.

    Args:
        arguments: names of benchmarks, and options of a single one.

    Returns:
        The exit code: 0, or 2 if a name is unknown or has no options.
    """
    available = names()
    named = list(takewhile(lambda argument: not argument.startswith("-"), arguments))
    options = arguments[len(named) :]
    takes_options = len(named) == 1 and named[0] in OPTIONS
    if not named or ({"-h", "--help"} & set(options) and not takes_options):
        print("usage: python -m benchmarks NAME [NAME ...]\n")
        for name in available:
            print(f"{name:<20} {summary(name)}")
        return 0
    unknown = [name for name in named if name not in available]
    if unknown:
        listed = ", ".join(available) or "none"
        print(f"There is no benchmark {unknown[0]!r}; there are: {listed}.", file=sys.stderr)
        return 2
    if options and not takes_options:
        print(f"Options go with one of {', '.join(sorted(OPTIONS))} alone.", file=sys.stderr)
        return 2
    for name in named:
        main_of = importlib.import_module(f"benchmarks.{name}").main
        main_of(options) if options else main_of()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
