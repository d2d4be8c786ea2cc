"""Build wheel and sdist, install each in a new environment of each Python, and use it there.

``python tools/try_distributions.py python3.11 python3.12 python3.13``, or `make distributions`.
Interpreters that are not installed are skipped. All commands run in an empty folder, so that they
cannot import from the checkout.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

USES = (
    (
        "-c",
        "import gymnasium as gym, numpy as np\n"
        "envs = gym.make_vec('kengoro_env:Kengoro/Elbow-v0', 2, robot_seed=1)\n"
        "envs.reset(seed=0)\n"
        "print(envs.step(envs.action_space.sample())[1])",
    ),
    ("-m", "kengoro", "record", "--arm", "elbow", "--duration", "4", "--out", "log"),
    ("-m", "reality_gap", "check", "log/STUDY.yaml"),
)
"""Arguments of Python for the commands that are tried; each must have exit code 0."""


def run(*command: str | Path, cwd: Path) -> float:
    """Run a command; exit with its output if it fails.

    Args:
        command: program and arguments.
        cwd: working folder.

    Returns:
        Time of the command [s].
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    begin = time.perf_counter()
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True)
    if done.returncode:
        line = " ".join(map(str, command))
        sys.exit(f"{line}\n{done.stdout}{done.stderr}\nThe exit code is {done.returncode}.")
    return time.perf_counter() - begin


def starts(interpreter: str) -> bool:
    """Whether an interpreter is installed; a shim of pyenv may exist without its interpreter."""
    found = shutil.which(interpreter)
    return bool(found) and not subprocess.run([found, "--version"], capture_output=True).returncode


def size_mb(folder: Path) -> float:
    """Size of all files in a folder [MB]."""
    return sum(p.stat().st_size for p in folder.rglob("*") if p.is_file()) / 1e6


def main(interpreters: list[str]) -> None:
    """Try each distribution with each interpreter.

    Args:
        interpreters: names or paths of Python interpreters.
    """
    found = [name for name in interpreters if starts(name)]
    missing = [name for name in interpreters if name not in found]
    if not found:
        sys.exit(
            f"None of these interpreters is installed: {', '.join(interpreters) or 'none given'}."
        )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(sys.executable, "-m", "build", "--outdir", folder / "dist", ROOT, cwd=folder)
        for interpreter in found:
            for built in sorted((folder / "dist").iterdir()):
                location, empty = folder / "venv", folder / "empty"
                empty.mkdir()
                run(interpreter, "-m", "venv", location, cwd=folder)
                python = location / "bin" / "python"
                installed = run(python, "-m", "pip", "install", "--quiet", built, cwd=empty)
                used = sum(run(python, *use, cwd=empty) for use in USES)
                print(
                    f"{interpreter}: {built.name} installed in {installed:.0f} s "
                    f"({size_mb(location):.0f} MB with dependencies), used for {used:.0f} s"
                )
                shutil.rmtree(location)
                shutil.rmtree(empty)
    for name in missing:
        print(f"{name}: not installed, not tried")


if __name__ == "__main__":
    main(sys.argv[1:])
