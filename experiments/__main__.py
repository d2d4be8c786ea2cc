"""`python -m experiments NAME --seeds A-B --out DIR` runs an experiment; `--help` lists them."""

from __future__ import annotations

import importlib
import os
import sys
from functools import partial
from pathlib import Path

RUNNERS = {
    "initial-training": "the drawing is learned (sec. IV-A)",
    "muscle-jacobian": "wavy or smooth moment arms (sec. IV-A)",
    "antagonism-elbow": "wires that fight give way (IV-B)",
    "vision-update": "the estimate comes to what is seen (IV-C)",
    "posture-accuracy": "both updaters, new postures (IV-D)",
    "can-grasping": "a can that was missed is grasped (sec. IV)",
    "adaptation": "wires give, and learning makes up for it",
    "ablation": "what each part is worth, and the paper's claims of it",
    "baselines": "what others would learn from the same measurements",
    "faults": "faults in the middle of learning are noticed and outlived",
    "wrong-observations": "what wrong looks teach is noticed and undone",
    "endurance": "hours of learning: the error stays where it came to",
    "all": "every experiment of the paper, and one page of results",
    "gap-to-skill": "a diagnosis of a minute's motion, as a map",
    "gap-bench": "hidden effects, diagnosed: how often it is right",
    "gap-calibrate": "how sure a diagnosis may be",
    "record": "a log of a robot that moves, as a study for reality_gap",
    "emps": "a measured drive: what a mass alone gets wrong of its force",
    "davinci": "a measured cable drive: what its transmission does",
    "remote-robot": "an agent drives a robot in another process",
    "learn-posture": "reinforcement learning, from the reward alone",
    "learnability": "what can be learned, from what, and the floor",
}
"""One line for each experiment; its runner is ``experiments/NAME/run.py``."""

WATCHABLE = (
    "muscle-jacobian",
    "vision-update",
    "posture-accuracy",
    "can-grasping",
    "adaptation",
    "ablation",
    "baselines",
    "gap-to-skill",
)
"""Experiments whose agents move a robot before the eyes of who gives --view."""

USAGE = "\n".join(
    [
        "usage: python -m experiments NAME --seeds A-B --out DIR [--jobs N] [OPTIONS]",
        "",
        *(f"  {name:<20}{line}" for name, line in RUNNERS.items()),
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

    from experiments.harness.common import Args
    from experiments.harness.errors import ExperimentError
    from experiments.harness.experiment import run_study
    from jmm_agent.errors import AgentError
    from kengoro_env.errors import KengoroError
    from reality_gap.errors import RealityGapError

    runner = importlib.import_module(f"experiments.{name.replace('-', '_')}.run")
    program = f"python -m experiments {name}"
    if hasattr(runner, "main"):
        run, args = runner.main, tyro.cli(runner.Args, args=rest, prog=program)
    else:
        usual = Args(seeds="0-9", out=Path("out") / name)
        told = runner.STUDY.introduction
        run = partial(run_study, runner.STUDY)
        args = tyro.cli(Args, args=rest, prog=program, default=usual, description=told)
    try:
        if getattr(args, "view", False) and name not in WATCHABLE:
            raise ExperimentError(
                f"{name} cannot be watched: leave out --view. These can: {', '.join(WATCHABLE)}."
            )
        run(args)
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return 130
    except (ExperimentError, AgentError, KengoroError, RealityGapError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
