"""State of a robot, from which it continues with the same bits, in this or another process."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kengoro_env.robot.draft import Event
from kengoro_env.types import Floats


@dataclass
class RobotState:
    """What changes while a robot moves.

    Attributes:
        physics: MuJoCo's state.
        forces: forces of the actuators in the last time step (nu,) [N, N m]; friction follows them.
        fields: arrays of the model that steps change, by name.
        elongation: permanent elongation of the tendons (m,) [m].
        target: target lengths as the encoders read them (m,) [m].
        random: generator of the sensors' noise.
        events: elongations to come in this episode, the next one first.
    """

    physics: Floats
    forces: Floats
    fields: dict[str, Floats]
    elongation: Floats
    target: Floats
    random: np.random.Generator
    events: list[Event]
