"""The built wheel holds what it needs, and runs where there is no checkout."""

import itertools
import os
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pinocchio
import pytest

from tests.snippets import blocks

ROOT = Path(__file__).resolve().parents[1]
ASSETS_IN_WHEEL = "kengoro_env/assets_data"
PACKAGES = ("jmm_agent", "kengoro", "kengoro_env", "mjcf_sandbox", "reality_gap")
"""What the wheel installs; everything else stays in the checkout."""


def files_below(folder: Path) -> set[str]:
    """Paths below `folder`, relative to it, without byte code."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix() for path in found if path.suffix != ".pyc"}


def run(*command: str | Path, cwd: Path) -> str:
    """Standard output of `command`, run without the checkout on its path."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the checkout with the build backend that is installed."""
    folder = tmp_path_factory.mktemp("dist")
    build = (sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT)
    run(*build, cwd=folder)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def names(wheel: Path) -> set[str]:
    """Names of the files in the wheel."""
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_wheel_holds_every_asset(names: set[str]) -> None:
    assets = files_below(ROOT / "assets")
    assert "mjcf/kengoro_arm/arm.xml" in assets
    assert {f"{ASSETS_IN_WHEEL}/{name}" for name in assets} <= names


def test_wheel_holds_every_file_that_the_mjcf_names(wheel: Path, names: set[str]) -> None:
    referenced = set()
    with zipfile.ZipFile(wheel) as archive:
        for model in (name for name in names if name.endswith(".xml")):
            tree = ElementTree.fromstring(archive.read(model))
            compiler = {k: v for node in tree.iter("compiler") for k, v in node.attrib.items()}
            folders = {
                "texture": compiler.get("texturedir", compiler.get("assetdir", "")),
                "mesh": compiler.get("meshdir", compiler.get("assetdir", "")),
            }
            for node in tree.iter():
                for attribute, value in node.attrib.items():
                    if attribute.startswith("file"):
                        path = Path(model).parent / folders.get(node.tag, "") / value
                        referenced.add(Path(os.path.normpath(path)).as_posix())
    assert any(name.endswith(".png") for name in referenced)
    assert referenced <= names


def test_wheel_holds_every_module_and_no_more(names: set[str]) -> None:
    expected = {f"{name}/{path}" for name in PACKAGES for path in files_below(ROOT / name)}
    assert {"kengoro_env/__init__.py", "kengoro/__init__.pyi", "jmm_agent/py.typed"} <= expected
    modules = {name for name in names if ".dist-info/" not in name}
    assert {name for name in modules if not name.startswith(ASSETS_IN_WHEEL)} == expected


@pytest.mark.parametrize("file", ["LICENSE", "NOTICE"])
def test_wheel_holds_the_licence(names: set[str], file: str) -> None:
    assert any(name.endswith(f".dist-info/licenses/{file}") for name in names)


@pytest.fixture(scope="module")
def elsewhere(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Python of a fresh environment with the wheel and the dependencies, and an empty folder."""
    folder = tmp_path_factory.mktemp("elsewhere")
    venv.create(folder / "venv", with_pip=False)
    python = folder / "venv" / "bin" / "python"
    pip = (sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check")
    run(*pip, "install", "--quiet", "--no-deps", "--no-index", wheel, cwd=folder)
    # The dependencies come from the environment that runs the tests. A .pth file there, such as
    # the editable install's, is not read again from here: the checkout stays out of sight.
    (site_packages,) = (folder / "venv").glob("lib/python*/site-packages")
    folders = [sysconfig.get_path("purelib"), str(Path(pinocchio.__file__).parents[1])]
    (site_packages / "dependencies.pth").write_text("\n".join(folders))
    (folder / "empty").mkdir()
    return python, folder / "empty"


@pytest.mark.parametrize(
    ("identifier", "options"),
    [
        ("Kengoro/Elbow-v0", ""),
        ("Kengoro/Posture-v0", ", camera=False"),
        ("Kengoro/CanGrasp-v0", ", camera=False"),
    ],
)
def test_installed_wheel_makes_environments(
    elsewhere: tuple[Path, Path], identifier: str, options: str
) -> None:
    python, empty = elsewhere
    program = (
        "import gymnasium, kengoro_env;"
        f"gymnasium.make('{identifier}'{options}).reset(seed=0);"
        "print(kengoro_env.__file__)"
    )
    module = Path(run(python, "-c", program, cwd=empty).splitlines()[-1])
    assert module.is_relative_to(python.parents[1])


def test_torch_is_of_the_core_and_of_no_extra() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert [name for name in project["dependencies"] if name.startswith("torch~=")]
    extras = itertools.chain(*project["optional-dependencies"].values())
    assert not [name for name in extras if name.startswith("torch")]


def test_installed_wheel_trains(elsewhere: tuple[Path, Path]) -> None:
    python, empty = elsewhere
    program = (
        "from jmm_agent.mapping import recipe, training;"
        "from kengoro.trained_maps import nominal_model;"
        "few = recipe.Recipe(hidden=20, samples=500, steps=2);"
        "report = training.train(nominal_model(), 0, few)[1];"
        "print(training.__file__, report.groups['neck'].validation_rmse)"
    )
    module, error = run(python, "-c", program, cwd=empty).split()
    assert Path(module).is_relative_to(python.parents[1])
    assert 0.0 < float(error) < 0.1


@pytest.fixture
def crowded(tmp_path: Path) -> Path:
    """A folder of somebody who has packages called ``experiments`` and ``tests``."""
    for name in ("experiments", "tests"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('not this one')\n")
    return tmp_path


def test_installed_wheel_runs_the_snippets_of_the_readme(
    elsewhere: tuple[Path, Path], crowded: Path
) -> None:
    snippets = list(blocks(ROOT / "README.md"))
    assert snippets
    (crowded / "readme.py").write_text("\n".join(code for _, code in snippets))
    run(elsewhere[0], "readme.py", cwd=crowded)


def test_installed_wheel_has_the_console_scripts(
    elsewhere: tuple[Path, Path], crowded: Path
) -> None:
    scripts = elsewhere[0].parent
    for name in ("kengoro", "reality-gap"):
        assert run(scripts / name, "--version", cwd=crowded) == f"{name} 0.1.0\n"
    assert "coulomb_friction" in run(scripts / "reality-gap", "causes", cwd=crowded)
    run(
        scripts / "kengoro",
        "record",
        "--out",
        "log",
        "--arm",
        "elbow",
        "--duration",
        "3",
        cwd=crowded,
    )
    assert (crowded / "log" / "STUDY.yaml").exists()


def test_installed_wheel_names_the_repository_of_the_experiments(
    elsewhere: tuple[Path, Path], crowded: Path
) -> None:
    python = elsewhere[0]
    for command in ([python.parent / "kengoro"], [python, "-m", "kengoro"]):
        done = subprocess.run(
            [*command, "experiments"], cwd=crowded, capture_output=True, text=True
        )
        assert done.returncode == 2
        assert "The experiments are in the repository" in done.stderr
