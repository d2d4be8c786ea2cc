"""Print what each extra adds to an installation [MB], [packages]: ``python tools/weigh_extras.py``.

The core is installed into one environment, and the core with each extra into another one; the
differences are printed. So is what torch takes by itself, the largest library of the core: its
build for CPUs is far smaller than the one with CUDA, and pip's index decides which one it is.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import tomllib
from pathlib import Path

from try_distributions import ROOT, run, size_mb


def weigh(requirement: str, folder: Path) -> tuple[float, set[str]]:
    """Install a requirement into a new environment.

    Args:
        requirement: as pip takes it.
        folder: where the environment is made, and removed.

    Returns:
        Size of all packages [MB], and their names with their versions.
    """
    location = folder / "environment"
    run(sys.executable, "-m", "venv", "--without-pip", location, cwd=folder)
    target = next(location.glob("lib/python*/site-packages"))
    pip = (sys.executable, "-m", "pip", "--python", location, "--disable-pip-version-check")
    run(*pip, "install", "--quiet", requirement, cwd=folder)
    found = size_mb(target), {info.stem for info in target.glob("*.dist-info")}
    shutil.rmtree(location)
    return found


def main() -> None:
    """Print the sizes of the core, of torch in it, and of each extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    [torch] = [name for name in project["dependencies"] if name.startswith("torch")]
    with tempfile.TemporaryDirectory() as name:
        core, packages = weigh(str(ROOT), Path(name))
        print(f"core: {core:.0f} MB, {len(packages)} packages", flush=True)
        size, alone = weigh(torch, Path(name))
        [build] = [package for package in alone if package.startswith("torch-")]
        print(f"{build} and its needs: {size:.0f} MB, {len(alone)} packages", flush=True)
        for extra in project["optional-dependencies"]:
            size, more = weigh(f"{ROOT}[{extra}]", Path(name))
            added = len(more) - len(packages)
            print(f"[{extra}]: + {size - core:.0f} MB, + {added} packages", flush=True)


if __name__ == "__main__":
    main()
