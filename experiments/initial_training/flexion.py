"""Shoulder flexion: the pitch through its range while all other joints stand at zero."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from jmm_agent.mapping.joint_muscle_map import METRES
from jmm_agent.nominal_model import NominalModel
from jmm_agent.types import Floats

PITCH = "sh_pitch"
POINTS = 61


class Flexion:
    """The movement on which the paper shows lengths and Jacobians of the shoulder's ten muscles.

    Attributes:
        joint: index of the pitch.
        postures: (K, n) [rad].
        degrees: angles of the pitch (K,) [deg].
        muscles: indices of the shoulder's muscles (k,).
        names: their names.
    """

    def __init__(self, drawing: NominalModel) -> None:
        self.joint = drawing.joints.index(PITCH)
        angles = np.linspace(drawing.lower[self.joint], drawing.upper[self.joint], POINTS)
        self.postures = np.zeros((POINTS, len(drawing.joints)))
        self.postures[:, self.joint] = angles
        self.degrees = np.degrees(angles)
        [self.muscles] = [of.muscle_index for of in drawing.topology() if of.name == "shoulder"]
        self.names = [drawing.muscles[muscle] for muscle in self.muscles]

    def lengths(self, lengths: Callable[[Floats], Floats]) -> Floats:
        """Lengths (K, k) [mm] of the shoulder's muscles, by a drawing's or map's `lengths`."""
        return lengths(self.postures)[:, self.muscles] / METRES
