"""Commands of the next experiment, and how well it separates the candidates."""

from __future__ import annotations

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reality_gap.diagnosis import Experiment
from reality_gap.report.formatting import number, shown
from reality_gap.report.plots.canvas import AFTER, QUIET, figure
from reality_gap.study.system import commanded

MOST = 6
"""Largest number of commands in the picture."""


def commands(experiment: Experiment, model: mujoco.MjModel) -> Figure:
    """Plot the commands that change most, and the separation of the candidates before and after."""
    moved = np.ptp(experiment.command, axis=0)
    chosen = sorted(np.argsort(-moved, kind="stable")[:MOST].tolist())
    made, axes = figure(11, 3.4, 1, 2, width_ratios=(3, 1))
    ax = axes[0, 0]
    actuators = [commanded(model)[column] for column in chosen]
    units = [_unit(model, i) for i in actuators]
    for column, i, unit in zip(chosen, actuators, units, strict=True):
        factor, name = shown(unit)
        label = f"{model.actuator(i).name} [{name}]" if name else model.actuator(i).name
        ax.step(experiment.time, factor * experiment.command[:, column], where="post", label=label)
    ax.set_xlabel("time [s]", fontsize=9)
    names = sorted({shown(unit)[1] for unit in units} - {""})
    ax.set_ylabel(f"command [{names[0]}]" if len(names) == 1 else "command", fontsize=9)
    ax.legend(fontsize=8, ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    _separation(axes[0, 1], experiment)
    return made


def left_out(experiment: Experiment) -> int:
    """Return the number of commands that the picture does not show."""
    return max(0, experiment.command.shape[1] - MOST)


def _separation(ax: Axes, experiment: Experiment) -> None:
    values = (experiment.separation_before, experiment.separation)
    ax.bar((0, 1), values, color=(QUIET, AFTER), width=0.6)
    for x, value in enumerate(values):
        ax.annotate(number(value, 2), (x, value), ha="center", va="bottom", fontsize=9)
    ax.set_xticks((0, 1), ("these data", "with this\nexperiment"), fontsize=8)
    ax.set_ylim(0.0, 1.15 * max(values) + 1e-9)
    ax.set_ylabel("separation of the candidates\n[standard deviations]", fontsize=8)


def _unit(model: mujoco.MjModel, actuator: int) -> str:
    """Return the SI unit of a position servo's command, or "1" for other actuators."""
    if model.actuator_biasprm[actuator, 1] == 0.0:
        return "1"
    kind = int(model.actuator_trntype[actuator])
    if kind == int(mujoco.mjtTrn.mjTRN_TENDON):
        return "m"
    if kind != int(mujoco.mjtTrn.mjTRN_JOINT):
        return "1"
    joint = int(model.actuator_trnid[actuator, 0])
    return "rad" if model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_HINGE) else "m"
