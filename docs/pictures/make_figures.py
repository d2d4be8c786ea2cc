"""Make the figures of concepts.md and emps.md.

    python docs/pictures/make_figures.py                     # mapping.png and stiffness.png
    python docs/pictures/make_figures.py --log emps.csv      # emps.png, too

``mapping.png``: muscle lengths of the elbow in the nominal model and the actual robot of seed 1.
``stiffness.png``: the law of muscle stiffness control. ``emps.png``: the measured force of the
EMPS drive, and the remainder after the causes in ``docs/results/emps.json``; nothing is fitted.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.emps.log import (
    MASS,
    at_readings,
    make_study,
    measured_force,
    motion,
    read_log,
    relative_error,
)
from experiments.emps.regression import force_of
from jmm_agent.types import Floats
from kengoro_env.robot.muscle_law import DEFAULT_GAINS
from reality_gap.study.data import Study

FOLDER = Path(__file__).resolve().parent
RESULT = FOLDER.parent / "results" / "emps.json"
BLACK, GREY, BLUE, GREEN, ORANGE = "#222222", "#999999", "#0072B2", "#009E73", "#D55E00"
ROBOT = 1


def save(figure: Any, name: str) -> None:
    """Write a figure beside this file."""
    figure.savefig(FOLDER / name, dpi=110)
    pyplot.close(figure)


def elbow_lengths(robot_seed: int | None, angles: Floats) -> tuple[tuple[str, ...], Floats]:
    """Muscles, and the lengths (k, m) [m] that their encoders read at angles (k,) [rad]."""
    env: Any = gym.make("kengoro_env:Kengoro/Elbow-v0", robot_seed=robot_seed).unwrapped
    read = [env.reset(seed=0, options={"posture": [a]})[0]["lengths"] for a in angles]
    return env.muscles, np.array(read)


def mapping() -> None:
    """Nominal lengths of three muscles, and readings of a robot's encoders."""
    angles = np.radians(np.linspace(0.0, 120.0, 61))
    muscles, nominal = elbow_lengths(None, angles)
    _, read = elbow_lengths(ROBOT, angles)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    for i, colour in enumerate((BLUE, GREEN, ORANGE)):
        left.plot(np.degrees(angles), 1e3 * nominal[:, i], color=colour, label=muscles[i])
        left.plot(np.degrees(angles), 1e3 * read[:, i], "--", color=colour)
        right.plot(np.degrees(angles), 1e3 * (read - nominal)[:, i], color=colour, label=muscles[i])
    left.plot([], [], color=GREY, label="nominal")
    left.plot([], [], "--", color=GREY, label=f"actual robot, seed {ROBOT}")
    left.set(xlabel="true elbow angle [deg]", ylabel="muscle length [mm]")
    right.set(xlabel="true elbow angle [deg]", ylabel="robot - nominal [mm]")
    left.legend(fontsize=8)
    right.axhline(0.0, color=GREY, lw=0.8, zorder=0)
    right.legend(fontsize=8)
    save(figure, "mapping.png")


def stiffness() -> None:
    """Tension over length, of a muscle that pulls and of one that does not."""
    gains = DEFAULT_GAINS
    beyond = np.linspace(-10e-3, 20e-3, 301)

    def tension(x: Floats | float) -> Any:
        return np.minimum(
            gains.bias + np.maximum(0.0, gains.stiffness * np.asarray(x)), gains.limit
        )

    figure, axis = pyplot.subplots(figsize=(7, 3.6), layout="constrained")
    axis.plot(1e3 * beyond, tension(beyond), color=BLACK)
    for x, location, colour, words in (
        (7e-3, (5.5, 400.0), ORANGE, "pulls: its l_target determines\nthe force in this posture"),
        (-6e-3, (-5.5, 160.0), BLUE, "does not pull: a longer\nl_target has the same effect"),
    ):
        axis.plot(1e3 * x, tension(x), "o", color=colour)
        axis.annotate(
            words,
            (1e3 * x, float(tension(x))),
            xytext=location,
            ha="center",
            color=colour,
            arrowprops={"arrowstyle": "-", "color": colour},
        )
    axis.axvline(0.0, color=GREY, lw=0.8, zorder=0)
    axis.set(xlabel="l - l_target [mm]", ylabel="tension [N]", ylim=(0.0, 540.0))
    save(figure, "stiffness.png")


def emps(path: Path) -> None:
    """Force of the drive, force of a mass alone, and remainder after the named causes."""
    log = read_log(path)
    study = make_study(log)
    force, alone = measured_force(study), force_of(study, {"mass": MASS})
    time = study.episodes[0].readings[0].time
    summary = json.loads(RESULT.read_text(encoding="utf-8"))
    textbook, by_direction = _named_forces(study, summary)
    velocity = at_readings(study, motion(study).qvel[:, 0])
    even = np.abs(at_readings(study, motion(study).qacc[:, 0])) < 0.05
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 3.8), layout="constrained")
    shown = time < 7.0
    left.plot(time[shown], alone[shown], color=GREY, lw=1, label="mass alone")
    left.plot(time[shown], force[shown], color=BLACK, lw=1, label="measured")
    left.set(xlabel="time [s]", ylabel="force [N]", xlim=(0.0, 7.0), ylim=(-170.0, 215.0))
    left.legend(loc="upper right", ncols=2, fontsize=8)
    for computed, colour, name, key in (
        (textbook, ORANGE, "textbook causes", "textbook causes"),
        (by_direction, BLUE, "friction by direction", "all causes"),
    ):
        error = relative_error(force, computed)
        print(f"{name}: {error:.2f} %; {RESULT.name} has {summary['errors'][key]} %")
        _quartiles(right, velocity[even], (force - computed)[even], colour, name)
    right.axhline(0.0, color=GREY, lw=0.8, zorder=0)
    right.set(xlabel="velocity [m/s]", ylabel="measured - computed force [N]", ylim=(-3.0, 4.2))
    right.legend(loc="upper left", fontsize=8)
    save(figure, "emps.png")


def _named_forces(study: Study, summary: dict[str, Any]) -> tuple[Floats, Floats]:
    """Forces of the model with the named textbook causes, and with direction-dependent friction."""
    values = {
        cause["cause"]: {name: e["value"] for name, e in cause["parameters"].items()}
        for cause in summary["named"]
    }
    textbook = {
        "mass": MASS,
        "coulomb": values["coulomb_friction"]["friction"],
        "viscous": values["viscous_friction"]["damping"],
        "offset": -values["force_offset"]["force"],
    }
    friction = values["direction_dependent_friction"]
    dry, dry_more = _halves(friction["forward"], friction["backward"])
    viscous, viscous_more = _halves(friction["forward_viscous"], friction["backward_viscous"])
    by_direction = {
        "mass": MASS,
        "coulomb": dry,
        "offset": dry_more,
        "viscous": viscous,
        "viscous by direction": viscous_more,
    }
    return force_of(study, textbook), force_of(study, by_direction)


def _halves(forward: float, backward: float) -> tuple[float, float]:
    """Mean of both directions, and difference of the forward one from it."""
    return (forward + backward) / 2, (forward - backward) / 2


def _quartiles(axis: Axes, velocity: Floats, left: Floats, colour: str, name: str) -> None:
    """Draw median and quartiles at each constant velocity of the carriage."""
    speeds = np.round(velocity, 2)
    held = [speed for speed in np.unique(speeds) if np.sum(speeds == speed) > 20]
    low, middle, high = np.array(
        [np.quantile(left[speeds == speed], (0.25, 0.5, 0.75)) for speed in held]
    ).T
    error = (middle - low, high - middle)
    axis.errorbar(held, middle, yerr=error, fmt="o-", color=colour, label=name, capsize=3)


def main() -> None:
    """Write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--log", type=Path, help="the EMPS log, for emps.png")
    log = parser.parse_args().log
    mapping()
    stiffness()
    if log is not None:
        emps(log)


if __name__ == "__main__":
    main()
