"""Runners: every experiment in the list follows the one protocol."""

from __future__ import annotations

import dataclasses
import importlib
import inspect

import pytest

from experiments.__main__ import RUNNERS
from experiments.harness.common import ROOT


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
