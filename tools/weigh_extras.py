"""Print what each extra adds to an installation [MB], [packages]: ``python tools/weigh_extras.py``.

The core is installed into one environment, and the core with each extra into another one; the
differences are printed.
"""

from __future__ import annotations

import sys
import tempfile
import tomllib
from pathlib import Path

from try_distributions import ROOT, run, size_mb


def weigh(extra: str, folder: Path) -> tuple[float, int]:
    """Install the core with an extra into a new environment.

    Args:
        extra: name of the extra; "" for the core alone.
        folder: where the environment is made.

    Returns:
        Size of all packages [MB], and their number.
    """
    location = folder / (extra or "core")
    run(sys.executable, "-m", "venv", "--without-pip", location, cwd=folder)
    requirement = f"{ROOT}[{extra}]" if extra else str(ROOT)
    target = next(location.glob("lib/python*/site-packages"))
    pip = (sys.executable, "-m", "pip", "--python", location, "--disable-pip-version-check")
    run(*pip, "install", "--quiet", requirement, cwd=folder)
    return size_mb(target), len(list(target.glob("*.dist-info")))


def main() -> None:
    """Print the sizes of the core and of each extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    with tempfile.TemporaryDirectory() as name:
        core = weigh("", Path(name))
        print(f"core: {core[0]:.0f} MB, {core[1]} packages", flush=True)
        for extra in project["optional-dependencies"]:
            size, count = weigh(extra, Path(name))
            print(f"[{extra}]: + {size - core[0]:.0f} MB, + {count - core[1]} packages", flush=True)


if __name__ == "__main__":
    main()
