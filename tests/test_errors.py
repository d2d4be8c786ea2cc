"""Our errors come out of other processes as they went in: else a pool hangs or tells nonsense."""

from __future__ import annotations

import ast
import functools
import importlib
import multiprocessing.reduction
import pickle  # noqa: TID251  (what pools do with errors)
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = SETTINGS["tool"]["importlinter"]["root_packages"]
ARGUMENTS: dict[str, tuple[object, ...]] = {
    "UnknownNameError": ("muscle", "deltoid", ["biceps", "triceps"]),
    "DivergedError": (),
    "TimeLimitError": (20.0, "screening 7 candidates"),
}
"""Of errors that take something else than one sentence."""


@functools.cache
def error_classes() -> list[tuple[str, str]]:
    """Module and name of every class in our packages that is called an error and derives from
    another class."""
    found = []
    for path in sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py")):
        module = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
        text = path.read_text(encoding="utf-8")
        if "Error(" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ClassDef) and node.bases and node.name.endswith("Error"):
                found.append((module, node.name))
    return found


@pytest.mark.parametrize(("module", "name"), error_classes())
def test_an_error_survives_its_transfer_to_another_process(module: str, name: str) -> None:
    error = getattr(importlib.import_module(module), name)(*ARGUMENTS.get(name, ("It broke.",)))
    again = pickle.loads(multiprocessing.reduction.ForkingPickler.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error) != ""


def test_all_of_them_were_found() -> None:
    names = {name for _, name in error_classes()}
    assert {"UnknownNameError", "DivergedError", "StudyError", "CheckpointError"} <= names
