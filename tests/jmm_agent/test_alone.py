"""The agent and its tests need no other package of this repository but `mjcf_sandbox`."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OTHERS = {"kengoro", "kengoro_env", "reality_gap", "hidden_plants", "experiments", "benchmarks"}


def imported(path: Path) -> set[str]:
    """Top-level names of all imports of a Python file."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.partition(".")[0])
    return found


@pytest.mark.parametrize("folder", ["jmm_agent", "tests/jmm_agent"])
def test_no_file_imports_another_package(folder: str) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    assert len(files) > 10
    assert {path.name: imported(path) & OTHERS for path in files if imported(path) & OTHERS} == {}


def test_an_import_of_another_package_is_found(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text("def later():\n    from kengoro_env.names import JOINTS\nimport mujoco\n")
    assert imported(path) & OTHERS == {"kengoro_env"}
