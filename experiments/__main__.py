"""`python -m experiments NAME --seeds A-B --out DIR` runs an experiment; `--help` lists them."""

from __future__ import annotations

import importlib
import os
import sys

RUNNERS = {
    "vision-update": ("experiments.vision_update", "the estimate comes to what is seen (IV-C)"),
    "can-grasping": ("experiments.can_grasping", "a can that was missed is grasped (sec. IV)"),
    "learnability": ("experiments.learnability", "what can be learned, from what, and the floor"),
}
"""Module and one line for each experiment."""

USAGE = "\n".join(
    [
        "usage: python -m experiments NAME --seeds A-B --out DIR [--jobs N] [OPTIONS]",
        "",
        *(f"  {name:<18}{line}" for name, (_, line) in RUNNERS.items()),
        "",
        "python -m experiments NAME --help lists the options of one.",
    ]
)


def pin_threads() -> None:
    """One thread for sums: the same seed gives the same bits. Numpy reads it when imported."""
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"


def main(arguments: list[str]) -> int:
    """Run the experiment named first in ``arguments`` with the rest; returns the exit code."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE)
        return 0 if arguments else 2
    name, *rest = arguments
    if name not in RUNNERS:
        print(f"There is no experiment {name!r}; there are: {', '.join(RUNNERS)}.", file=sys.stderr)
        return 2
    pin_threads()
    import tyro

    from experiments.errors import ExperimentError
    from jmm_agent.errors import AgentError
    from kengoro_env.errors import KengoroError

    runner = importlib.import_module(RUNNERS[name][0])
    options = tyro.cli(runner.Args, args=rest, prog=f"python -m experiments {name}")
    try:
        runner.main(options)
    except (ExperimentError, AgentError, KengoroError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
