"""What each extra adds to an installation, in MB and packages: ``python tools/weigh_extras.py``.

Each is installed into an environment of its own, beside the core; what is more is its weight.
"""

from __future__ import annotations

import sys
import tempfile
import tomllib
from pathlib import Path

from try_distributions import ROOT, run, size_mb


def weigh(extra: str, folder: Path) -> tuple[float, int]:
    """Size [MB] of the packages that the core with an extra needs, and their number."""
    location = folder / (extra or "core")
    run(sys.executable, "-m", "venv", "--without-pip", location, cwd=folder)
    wanted = f"{ROOT}[{extra}]" if extra else str(ROOT)
    target = next(location.glob("lib/python*/site-packages"))
    pip = (sys.executable, "-m", "pip", "--python", location, "--disable-pip-version-check")
    run(*pip, "install", "--quiet", wanted, cwd=folder)
    return size_mb(target), len(list(target.glob("*.dist-info")))


def main() -> None:
    """Weigh the core and each extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    with tempfile.TemporaryDirectory() as name:
        core = weigh("", Path(name))
        print(f"core: {core[0]:.0f} MB, {core[1]} packages", flush=True)
        for extra in project["optional-dependencies"]:
            size, count = weigh(extra, Path(name))
            print(f"[{extra}]: + {size - core[0]:.0f} MB, + {count - core[1]} packages", flush=True)


if __name__ == "__main__":
    main()
