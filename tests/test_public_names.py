"""The public names of the packages: importable, documented, and imported only when used."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("jmm_agent", "kengoro", "kengoro_env", "reality_gap")
HEAVY = {
    "jmm_agent": {"numpy", "scipy", "cv2", "pinocchio", "filterpy"},
    "kengoro": {"numpy", "mujoco", "gymnasium", "cv2", "pinocchio", "matplotlib", "reality_gap"},
    "kengoro_env": {"mujoco", "scipy", "kengoro_env.env"},
    "reality_gap": {"numpy", "scipy", "mujoco", "matplotlib", "pyarrow"},
}
"""Modules that the import of a package alone must not import."""


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_there(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__all__ == sorted(set(module.__all__))
    for name in module.__all__:
        assert getattr(module, name).__doc__, f"{package}.{name} has no docstring"


@pytest.mark.parametrize("package", PACKAGES)
def test_the_reference_documents_the_public_names_and_no_others(package: str) -> None:
    page = (ROOT / f"docs/reference/{package}.md").read_text(encoding="utf-8")
    documented = set(re.findall(rf"^::: {package}\.(?:\w+\.)*(\w+)$", page, re.MULTILINE))
    assert documented == set(importlib.import_module(package).__all__)


@pytest.mark.parametrize("package", PACKAGES)
def test_the_import_of_a_package_imports_nothing_heavy(package: str) -> None:
    code = f"import sys, {package}; print(*sys.modules)"
    modules = subprocess.check_output([sys.executable, "-c", code], text=True, cwd=ROOT).split()
    assert package in modules
    assert not HEAVY[package] & set(modules)


@pytest.mark.parametrize("package", [*PACKAGES, "mjcf_sandbox"])
def test_a_type_checker_finds_the_types(package: str) -> None:
    assert (ROOT / package / "py.typed").exists()
