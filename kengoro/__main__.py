"""The console script `kengoro`: a demonstration, recordings, a viewer, and the experiments."""

from __future__ import annotations

import importlib
import os
import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

COMMANDS = {
    "demo": "a robot misses a can, learns from what it sees of its hand, and grasps the can",
    "record": "a log of a moving robot and its study for reality-gap",
    "view": "watch a robot while it learns",
    "calibrate": "check clock, zero posture, signs, gains, limit and camera of a robot",
    "dataset": "grasps of robots that have learned, as LeRobot and Minari data sets",
    "hand-detector": "train a detector that finds a hand without a marker",
    "commission": "pull each muscle a little and name what is connected wrongly",
    "experiments": "list the experiments, which need a checkout of the repository",
}
"""One line for each command; ``kengoro.commands`` has a module with `Args` and `main` for it."""


def usage(program: str) -> str:
    """What the program prints without a command."""
    return "\n".join(
        [
            f"usage: {program} COMMAND [OPTIONS]",
            "",
            *(f"  {name:<15}{line}" for name, line in COMMANDS.items()),
            "",
            f"{program} COMMAND --help lists the options of one; {program} --version.",
        ]
    )


def main(arguments: list[str] | None = None) -> int:
    """Run the command named first in ``arguments``, or in the command line; the exit code."""
    name, *rest = (sys.argv[1:] if arguments is None else arguments) or [""]
    program = "kengoro" if sys.argv[0].endswith("kengoro") else "python -m kengoro"
    if name in ("", "-h", "--help"):
        print(usage(program))
        return 2 if name == "" else 0
    if name == "--version":
        print(_version())
        return 0
    if name not in COMMANDS:
        print(f"There is no command {name!r}; there are: {', '.join(COMMANDS)}.", file=sys.stderr)
        return 2
    # One thread for sums: the same seed gives the same bits. NumPy reads these at its import.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    if name == "experiments":
        return _experiments(rest)
    return _run(name, rest, f"{program} {name}")


def _run(name: str, arguments: list[str], program: str) -> int:
    import tyro

    from jmm_agent.errors import AgentError
    from kengoro.errors import UsageError
    from mjcf_sandbox.errors import OutputError
    from mjcf_sandbox.files import check_links

    try:
        from kengoro_env.errors import KengoroError

        command = importlib.import_module(f"kengoro.commands.{name.replace('-', '_')}")
    except RuntimeError as error:
        if "MUJOCO_GL" not in str(error):  # which is checked when the environments are imported
            raise
        print(error, file=sys.stderr)
        return 2
    args = tyro.cli(command.Args, args=arguments, prog=program)
    try:
        if isinstance(out := getattr(args, "out", None), Path):
            check_links(out)
        command.main(args)
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return 130
    except (UsageError, AgentError, KengoroError, OutputError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _experiments(arguments: list[str]) -> int:
    """Run `python -m experiments`, where this installation is a checkout."""
    found = find_spec("experiments")
    # Another package of this name is not imported to find out.
    folder = None if found is None or found.origin is None else Path(found.origin).parent
    if folder is None or not (folder / "harness").is_dir():
        print(
            "The experiments are in the repository, not in the installed package: clone it, run "
            "`make demo` there once, and then `.venv/bin/python -m experiments`.",
            file=sys.stderr,
        )
        return 2
    return int(importlib.import_module("experiments.__main__").main(arguments or ["--help"]))


def _version() -> str:
    try:
        return f"kengoro {version('kengoro')}"
    except PackageNotFoundError:
        return "kengoro is run from a folder in which it is not installed"


if __name__ == "__main__":
    sys.exit(main())
