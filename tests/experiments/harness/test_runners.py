"""Runners: every experiment in the list follows the one protocol."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect

import pytest

from experiments.__main__ import RUNNERS
from experiments.harness.common import ROOT, SHOWING


@pytest.mark.parametrize("name", RUNNERS)
def test_a_runner_has_args_with_a_help_text_and_a_main(name: str) -> None:
    runner = importlib.import_module(f"experiments.{name.replace('-', '_')}.run")
    assert dataclasses.is_dataclass(runner.Args)
    assert runner.Args.__doc__
    assert not runner.Args.__doc__.startswith("Args(")
    assert list(inspect.signature(runner.main).parameters) == ["args"]


def test_every_folder_with_a_runner_is_in_the_list() -> None:
    folders = {path.parent.name for path in (ROOT / "experiments").glob("*/run.py")}
    assert folders == {name.replace("-", "_") for name in RUNNERS}


def imported(folder: str) -> set[str]:
    """Other experiments whose code the results of an experiment depend on, also through others."""
    found: set[str] = set()
    for path in (ROOT / "experiments" / folder).rglob("*.py"):
        nodes = [] if path.name in SHOWING else ast.walk(ast.parse(path.read_text("utf-8")))
        modules = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
        parts = [module.split(".") for module in modules if module.startswith("experiments.")]
        found |= {part[1] for part in parts} - {folder, "harness", "robots"}
    return found.union(*(imported(other) for other in found))


def test_saved_results_are_those_of_all_code_that_they_depend_on() -> None:
    missing = {}
    for name in RUNNERS:
        module = importlib.import_module(f"experiments.{name.replace('-', '_')}.run")
        if experiment := getattr(module, "EXPERIMENT", None):
            own = {f"experiments/{other}" for other in imported(name.replace("-", "_"))}
            missing[name] = own - set(experiment.others)
    assert {name: folders for name, folders in missing.items() if folders} == {}
    assert len(missing) > 15
