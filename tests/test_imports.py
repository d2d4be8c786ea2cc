"""Who may import whom: the contracts in pyproject.toml are kept, and are red when broken."""

import itertools
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CONFIG = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LINTER = CONFIG["tool"]["importlinter"]
NOT_SHIPPED = {"tests", "tools"}
LAYERS = {
    contract["containers"][0]: [
        [module.strip() for module in layer.split("|")] for layer in contract["layers"]
    ]
    for contract in LINTER["contracts"]
    if contract["type"] == "layers"
}
"""Modules of each layer of a package, the highest layer first."""


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run import-linter on the packages in `folder`, by the contracts in its pyproject.toml."""
    return subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys; sys.path.insert(0, '.');"
            "from importlinter.cli import lint_imports; sys.exit(lint_imports(cache_dir=None))",
        ],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
    )


def loaded_by(package: str) -> set[str]:
    """Top-level names that a fresh interpreter holds after `import package`."""
    done = subprocess.run(
        [sys.executable, "-c", f"import {package}, sys; print(*sys.modules)"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return {name.partition(".")[0] for name in done.stdout.split()}


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    """A folder with the project's contracts and packages whose modules import nothing."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for package in LINTER["root_packages"]:
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
        for module in itertools.chain(*LAYERS.get(package, [])):
            (tmp_path / package / f"{module}.py").touch()
    for contract in LINTER["contracts"]:
        for name in contract.get("protected_modules", ()):
            add_module(tmp_path, name)
    return tmp_path


def add_module(folder: Path, name: str) -> None:
    """Add an empty module, and the packages that it is in."""
    *packages, last = name.split(".")
    for package in packages:
        folder /= package
        folder.with_suffix(".py").unlink(missing_ok=True)
        folder.mkdir(exist_ok=True)
        (folder / "__init__.py").touch()
    if not (folder / last).is_dir():
        (folder / f"{last}.py").touch()


def test_contracts_are_kept() -> None:
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_package_has_a_contract() -> None:
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")} - NOT_SHIPPED
    assert packages == set(LINTER["root_packages"])
    forbidding = [contract for contract in LINTER["contracts"] if contract["type"] == "forbidden"]
    sources = {name for contract in forbidding for name in contract["source_modules"]}
    assert packages - {"benchmarks"} == sources
    acyclic = [contract for contract in LINTER["contracts"] if contract["id"] == "acyclic"]
    assert packages == set(acyclic[0]["ancestors"])


def test_toy_packages_pass(toy: Path) -> None:
    done = lint(toy)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("importer", "imported"),
    [
        ("kengoro_env", "jmm_agent"),
        ("kengoro_env", "reality_gap"),
        ("kengoro_env", "hidden_plants"),
        ("kengoro_env", "experiments"),
        ("kengoro_env", "torch"),
        ("kengoro_env", "pinocchio"),
        ("kengoro_env", "cv2"),
        ("kengoro_env", "filterpy.kalman"),
        ("jmm_agent", "kengoro_env"),
        ("jmm_agent", "reality_gap"),
        ("jmm_agent", "hidden_plants"),
        ("jmm_agent", "experiments"),
        ("jmm_agent", "mujoco"),
        ("jmm_agent", "torch"),
        ("jmm_agent", "gymnasium.spaces"),
        ("reality_gap", "hidden_plants"),
        ("reality_gap", "kengoro_env"),
        ("reality_gap", "jmm_agent"),
        ("reality_gap", "torch"),
        ("hidden_plants", "reality_gap"),
        ("hidden_plants", "kengoro_env"),
        ("hidden_plants", "experiments"),
        ("mjcf_sandbox", "reality_gap"),
        ("mjcf_sandbox", "kengoro_env"),
        ("experiments", "benchmarks"),
    ],
)
def test_a_forbidden_import_is_found(toy: Path, importer: str, imported: str) -> None:
    # Inside a function, and one module away: a contract must see both.
    deep = LAYERS[importer][-1][0] if importer in LAYERS else "deep"
    (toy / importer / f"{deep}.py").write_text(f"def work():\n    import {imported}\n")
    (toy / importer / "__init__.py").write_text(f"from {importer} import {deep}\n")
    done = lint(toy)
    assert done.returncode == 1, done.stdout + done.stderr
    assert f"{importer}.{deep} -> {imported.partition('.')[0]}" in done.stdout


@pytest.mark.parametrize("importer", ["jmm_agent.driving", "kengoro.session", "experiments.all"])
def test_an_import_of_what_needs_torch_is_found(toy: Path, importer: str) -> None:
    # `jmm_agent.driving` may import it by the layers: the process must not be passed by.
    (toy / "jmm_agent" / "networks.py").write_text("import torch\n")
    file = toy / f"{importer.replace('.', '/')}.py"
    file.write_text("def work():\n    from jmm_agent import networks\n")
    done = lint(toy)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "nothing imports it but its like BROKEN" in " ".join(done.stdout.split())


def test_an_experiment_that_imports_the_training_of_a_detector_is_found(toy: Path) -> None:
    judge = toy / "experiments" / "hand_detector.py"
    judge.write_text("import kengoro.hand_detector\n")
    done = lint(toy)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "experiments.hand_detector -> kengoro.hand_detector" in done.stdout


@pytest.mark.parametrize("package", LAYERS)
def test_a_layer_that_imports_a_higher_one_is_found(toy: Path, package: str) -> None:
    for high, low in itertools.pairwise(LAYERS[package]):
        (toy / package / f"{low[0]}.py").write_text(f"import {package}.{high[0]}\n")
    done = lint(toy)
    assert done.returncode == 1, done.stdout + done.stderr
    for high, low in itertools.pairwise(LAYERS[package]):
        line = f"{package}.{low[0]} is not allowed to import {package}.{high[0]}"
        assert line in " ".join(done.stdout.split())


def test_a_module_outside_of_the_layers_is_found(toy: Path) -> None:
    (toy / "jmm_agent" / "somewhere_else.py").touch()
    done = lint(toy)
    assert done.returncode == 1
    assert "somewhere_else" in done.stdout


def test_a_circle_of_modules_is_found(toy: Path) -> None:
    folder = toy / "hidden_plants"
    (folder / "one.py").write_text("from hidden_plants import other\n")
    (folder / "other.py").write_text("def work():\n    from hidden_plants import one\n")
    done = lint(toy)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "no module imports itself in a circle BROKEN" in done.stdout


@pytest.mark.parametrize("imported", ["kengoro_env", "jmm_agent", "reality_gap", "hidden_plants"])
def test_experiments_may_import_both_sides(toy: Path, imported: str) -> None:
    (toy / "experiments" / "robots.py").write_text(f"import {imported}\n")
    done = lint(toy)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    "package", ["kengoro_env", "jmm_agent", "kengoro", "reality_gap", "experiments"]
)
def test_importing_a_package_stays_quick(package: str) -> None:
    # What takes about a second to load is loaded by the module that needs it, when it is needed.
    assert not loaded_by(package) & {"torch", "matplotlib"}


def test_the_environment_runs_without_the_agents_libraries() -> None:
    assert not loaded_by("kengoro_env") & {"torch", "pinocchio", "cv2", "filterpy", "jmm_agent"}


CONTROL_STEPS = """
import sys
import numpy as np
from tests.jmm_agent.small_map import make_map, postures
{do}
print("torch" in sys.modules, shared().process_id is None)
"""


@pytest.mark.parametrize(
    ("do", "no_process"),
    [
        ("make_map().lengths_and_jacobian(postures(1)[0])", True),
        ("ridge.move(make_map(), none, pairs)", True),
        ("MinibatchRule(steps=1).move(make_map(), none, pairs)", False),
    ],
    ids=["control step", "ridge rule", "minibatch rule"],
)
def test_torch_stays_out_of_the_process_and_the_ridge_rule_starts_none(
    do: str, no_process: bool
) -> None:
    begin = (
        "import jmm_agent",
        "from jmm_agent.agent import Agent",
        "from jmm_agent.mapping import training",
        "from jmm_agent.mapping.learner import Pairs, RidgeRule",
        "from jmm_agent.mapping.minibatch import MinibatchRule",
        "from jmm_agent.mapping.prior import MapPrior, PriorOptions",
        "from jmm_agent.mapping.torch_process import shared",
        "q = postures(5)",
        "none, pairs = Pairs.none(4, 5), Pairs(q, make_map(1).lengths(q), np.full(5, 1e-3))",
        "ridge = RidgeRule(MapPrior(make_map(), postures(20), PriorOptions()))",
        do,
    )
    done = subprocess.run(
        [sys.executable, "-c", CONTROL_STEPS.format(do="\n".join(begin))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["False", str(no_process)]
