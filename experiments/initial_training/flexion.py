"""Shoulder flexion: the pitch moves through its range while all other joints are at zero."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from jmm_agent.mapping.group_map import METRES
from jmm_agent.nominal_model import NominalModel
from jmm_agent.types import Floats

PITCH = "sh_pitch"
POINTS = 61
"""Number of postures of the movement."""


class Flexion:
    """Movement for which the paper shows lengths and Jacobians of the ten shoulder muscles.

    Args:
        nominal: model of the arm.

    Attributes:
        joint: index of the pitch.
        postures: joint angles, shape (K, n) [rad].
        degrees: angles of the pitch, shape (K,) [deg].
        muscles: indices of the shoulder's muscles, shape (k,).
        names: their names.
    """

    def __init__(self, nominal: NominalModel) -> None:
        self.joint = nominal.joints.index(PITCH)
        angles = np.linspace(nominal.lower[self.joint], nominal.upper[self.joint], POINTS)
        self.postures = np.zeros((POINTS, len(nominal.joints)))
        self.postures[:, self.joint] = angles
        self.degrees = np.degrees(angles)
        [self.muscles] = [of.muscle_index for of in nominal.topology() if of.name == "shoulder"]
        self.names = [nominal.muscles[muscle] for muscle in self.muscles]

    def lengths(self, lengths: Callable[[Floats], Floats]) -> Floats:
        """Lengths of the shoulder's muscles by a function of postures, shape (K, k) [mm]."""
        return lengths(self.postures)[:, self.muscles] / METRES
