"""Nominal model of the dVRK's patient side manipulator: the transmission of its data sheet.

Motors of the arm turn one joint each. Discs of the instrument turn roll, wrist pitch and wrist yaw
by the coupling that the dVRK user guide lists in its appendix of tools, here that of the large
needle driver 400006. Two discs share the wrist's yaw and the jaw; the jaw was not moved, so that
both turn alike but for a constant, and count as one.

A motor angle is the length of a cable on a wheel of `WHEEL`; which radius does not matter, because
all options of the agent follow the scale of the lengths. A slider has no angle: it enters as that
of a wheel of `PINION`, so that its range is comparable with those of the other joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.real_log.log import SLIDER, Log
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.recipe import Recipe
from jmm_agent.mapping.training import load_or_train
from jmm_agent.nominal_model import NominalModel
from jmm_agent.options import AgentOptions
from jmm_agent.scales import SAMPLES, RobotScales
from jmm_agent.types import Floats, Ints
from kengoro.trained_maps import MAP_SEED, default_cache

WHEEL, PINION = 0.01, 0.05
"""Radius of the wheels on which the motors' cables are thought to be wound, and of the wheel that
stands for the slider [m]."""
NAMES = ("yaw", "pitch", "insertion", "roll", "wrist pitch", "wrist yaw")
UNITS = ("deg", "deg", "mm", "deg", "deg", "deg")
TO_UNITS = np.where(np.arange(len(NAMES)) == SLIDER, 1e3 * PINION, np.degrees(1.0))
"""Factors from joint angles [rad] to `UNITS`."""
MOTORS = ("yaw motor", "pitch motor", "insertion motor", "disc 4", "disc 5", "discs 6 and 7")
GROUPS = {
    "yaw": ("yaw",),
    "pitch": ("pitch",),
    "insertion": ("insertion",),
    "roll": ("roll",),
    "wrist": ("wrist pitch", "wrist yaw"),
}
"""Joints that the data sheet couples with each other, and with no other joint."""
LIMITS = np.radians([[-91, 91], [-53, 53], [0, 0], [-260, 260], [-80, 80], [-80, 80]])
LIMITS[SLIDER] = 0.0, 0.24 / PINION
"""Lowest and highest angle of each joint (6, 2) [rad], by the dVRK user guide."""
COUPLING = np.diag([1.0, 1.0, 1.0, -1.5632, 1.0186, 2.0 * 0.6089])
COUPLING[5, 4] = -0.8306
"""Joint angles by motor angles (6, 6), by the dVRK user guide."""
TRANSMISSION = np.linalg.inv(COUPLING)
"""Motor angles by joint angles (6, 6)."""
QUICK_RECIPE = Recipe(hidden=100, samples=4000)


@dataclass(frozen=True)
class Machine:
    """What is known of the robot before its log is read.

    Attributes:
        map: joint-muscle map of the data sheet; a muscle is a motor's cable.
        typical: postures (N, 6) [rad] between the joint limits, which set the scale of the prior.
        options: of an agent of such a robot, all by default or by scale.
    """

    map: JointMuscleMap
    typical: Floats
    options: AgentOptions


def make_machine(cache: Path | None = None, quick: bool = False) -> Machine:
    """Train the map of the data sheet, or read it from the cache.

    Args:
        cache: folder of trained maps; the user's cache folder if left out.
        quick: whether a smaller network is trained.
    """
    low, high = LIMITS.T
    crosses = TRANSMISSION != 0.0
    nominal = NominalModel(NAMES, low, high, MOTORS, crosses, nominal_lengths, GROUPS)
    folder, recipe = cache or default_cache(), QUICK_RECIPE if quick else Recipe()
    jmm = load_or_train(nominal, MAP_SEED, folder, recipe)[0]
    typical = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(low)))
    scales = RobotScales(
        travel=float(np.median(nominal_lengths(typical).std(axis=0))),
        joint_range=float(np.median(high - low)),
        posture_range=float(np.linalg.norm(high - low)),
    )
    return Machine(jmm, typical, scales.agent_options())


def nominal_lengths(angles: Floats) -> Floats:
    """Lengths of the motors' cables (..., 6) [m] at joint angles (..., 6) [rad]."""
    return WHEEL * angles @ TRANSMISSION.T


def sheet_angles(lengths: Floats) -> Floats:
    """Joint angles (..., 6) [rad] by the data sheet's transmission."""
    return lengths @ COUPLING.T / WHEEL


def joint_angles(positions: Floats) -> Floats:
    """Joint angles (N, 6) [rad] of joint positions [rad, m]."""
    scale = np.ones(positions.shape[1])
    scale[SLIDER] = 1.0 / PINION
    return positions * scale


def cable_lengths(log: Log) -> Floats:
    """Lengths of the motors' cables (N, 6) [m] that the controller held."""
    return nominal_lengths(joint_angles(log.commanded))


def joints_of(group: str) -> Ints:
    """Indices of the joints of a group, which are those of its motors, too."""
    return np.array([NAMES.index(name) for name in GROUPS[group]])
