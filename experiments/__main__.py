"""Command line: `python -m experiments NAME --seeds A-B --out DIR`; `--help` lists the names.

A runner is a module ``experiments/NAME/run.py`` (with "_" for "-") that has:

* ``Args``: a dataclass of the options, whose docstring is the help text. Most subclass
  `experiments.harness.common.Args`;
* ``main(args)``: runs the experiment. Expected errors are exceptions of the packages, such as
  `ExperimentError`, whose message is printed as one sentence.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from pathlib import Path
from typing import NamedTuple


class Runner(NamedTuple):
    """Entry of the list of experiments.

    Attributes:
        description: for the list.
        watchable: whether ``--view`` can show its robots.
    """

    description: str
    watchable: bool = False


RUNNERS = {
    "initial-training": Runner("the map learns the nominal model (sec. IV-A)"),
    "muscle-jacobian": Runner("smoothness of the map's moment arms (sec. IV-A)", True),
    "antagonism-elbow": Runner("antagonistic muscles pull less after learning (sec. IV-B)"),
    "vision-update": Runner("the estimate approaches the observation (sec. IV-C)", True),
    "posture-accuracy": Runner("both updaters, tested on new postures (sec. IV-D)", True),
    "can-grasping": Runner("a can that was missed is grasped (sec. IV)", True),
    "adaptation": Runner("learning compensates for elongated muscles", True),
    "ablation": Runner("contribution of each part, and the paper's claims", True),
    "baselines": Runner("other methods, with the same measurements", True),
    "few-observations": Runner("errors after the first looks at the hand", True),
    "stiffness-and-load": Runner("soft muscles: errors, and stiffness by a push", True),
    "strange-robots": Runner("robots that the preset's departures do not describe", True),
    "wire-snaps": Runner("a wire snaps in motion, and the robot moves on with the others", True),
    "faults": Runner("faults during learning are detected and do no harm"),
    "hand-detector": Runner("the hand without a marker, in frames it was not trained on"),
    "wrong-observations": Runner("updates from wrong observations are detected and undone"),
    "endurance": Runner("hours of learning: the error stays low"),
    "clocks": Runner("time stamps that are not exact, and other control periods", True),
    "heat": Runner("motors that heat: core temperatures, their limit, faults of the cooling"),
    "all": Runner("every experiment of the paper, and one page of results"),
    "gap-to-skill": Runner("a diagnosis of a minute's motion, as a map", True),
    "gap-bench": Runner("hidden effects: how often the diagnosis is right"),
    "strangers-bench": Runner("hidden effects in machines of all kinds and sizes"),
    "estimator-variance": Runner("errors of estimated sizes beside their Cramer-Rao bound"),
    "gap-calibrate": Runner("calibration of the diagnosis's confidence"),
    "record": Runner("a log of a moving robot, as a study for reality_gap"),
    "emps": Runner("a measured drive: force that a mass alone does not explain"),
    "davinci": Runner("a measured cable drive: structure of its transmission"),
    "real-machines": Runner("measured machines, beside models that a person would fit"),
    "real-log": Runner("map and estimator on a measured cable-driven robot's log, offline"),
    "public-models": Runner("public MJCF models, each as it is and with a payload"),
    "other-robots": Runner("robots of other sizes and kinds, with default options"),
    "commissioning": Runner("swapped, reversed and absent muscles are named before learning"),
    "remote-robot": Runner("an agent drives a robot in another process"),
    "power-cycle": Runner("all lengths are zeroed anew: what was learned is used again"),
    "lab-faults": Runner("killed processes and broken lines: who stops the robot, how soon"),
    "learn-posture": Runner("reinforcement learning from the reward alone"),
    "learn-grasp": Runner("grasps on the drawing, from demonstrations or from the reward"),
    "clone-grasp": Runner("grasps cloned from robots that have learned, on other robots"),
    "posterior-policy": Runner("policies trained on what a diagnosis leaves open"),
    "learnability": Runner("what can be learned from which data, and the lower bound"),
    "reported": Runner("adds logged runs on reporting seeds to experiments/REPORTED.csv"),
}
"""Runners by name."""

WATCHABLE = tuple(name for name, runner in RUNNERS.items() if runner.watchable)

USAGE = "\n".join(
    [
        "usage: python -m experiments NAME --seeds A-B --out DIR [--jobs N] [OPTIONS]",
        "",
        *(f"  {name:<20}{runner.description}" for name, runner in RUNNERS.items()),
        "",
        "python -m experiments NAME --help lists the options of one.",
    ]
)


def pin_threads() -> None:
    """Use one thread for linear algebra, so that sums have the same bits on every run.

    NumPy reads the variables when it is imported.
    """
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"


def main(arguments: list[str]) -> int:
    """Run the experiment that the first argument names; returns the exit code."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE)
        return 0 if arguments else 2
    name, *rest = arguments
    if name not in RUNNERS:
        print(f"There is no experiment {name!r}; there are: {', '.join(RUNNERS)}.", file=sys.stderr)
        return 2
    pin_threads()
    import tyro

    from experiments.harness.errors import ExperimentError
    from jmm_agent.errors import AgentError
    from mjcf_sandbox.errors import OutputError
    from mjcf_sandbox.files import check_folder
    from reality_gap.errors import RealityGapError

    expected: tuple[type[Exception], ...]
    expected = (ExperimentError, AgentError, OutputError, RealityGapError)
    try:
        if importlib.util.find_spec("gymnasium"):  # which experiments with robots need
            from kengoro_env.errors import KengoroError

            expected = (*expected, KengoroError)
        runner = importlib.import_module(f"experiments.{name.replace('-', '_')}.run")
    except RuntimeError as error:
        if "MUJOCO_GL" not in str(error):  # which is checked when the environments are imported
            raise
        print(error, file=sys.stderr)
        return 2
    args = tyro.cli(runner.Args, args=rest, prog=f"python -m experiments {name}")
    try:
        if getattr(args, "view", False) and name not in WATCHABLE:
            raise ExperimentError(
                f"{name} cannot be watched: leave out --view. These can: {', '.join(WATCHABLE)}."
            )
        if isinstance(out := getattr(args, "out", None), Path):
            check_folder(out)
        runner.main(args)
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return 130
    except expected as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
