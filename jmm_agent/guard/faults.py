"""What is wrong with the robot right now, as far as its own senses show it.

Watchers look for one kind of symptom each: `wire_watch` at encoders, tension sensors and wires,
`sight_watch` at the camera and the marker, `motion_watch` at late commands and at pushes. The
`guard` asks them all, keeps what a fault touches from being learned, and holds commands within the
motors' limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats

ENCODER_DEAD = "encoder_dead"
ENCODER_STUCK = "encoder_stuck"
ENCODER_JUMP = "encoder_jump"
TENSION_SENSOR_DEAD = "tension_sensor_dead"
MUSCLE_SNAPPED = "muscle_snapped"
CAMERA_FROZEN = "camera_frozen"
MARKER_HIDDEN = "marker_hidden"
SECOND_MARKER = "second_marker"
MIRRORED_MARKER = "mirrored_marker"
COMMAND_LATE = "command_late"
PUSHED = "pushed"

KINDS = {
    ENCODER_DEAD: "the encoder gives no number",
    ENCODER_STUCK: "the encoder's reading no longer changes, not even by its noise",
    ENCODER_JUMP: "the encoder's reading jumped farther than a wire can move",
    TENSION_SENSOR_DEAD: "the tension sensor reads nothing, but the wire still moves as it should",
    MUSCLE_SNAPPED: "the wire has no tension and its motor winds it up",
    CAMERA_FROZEN: "no new picture comes, or the same one again while the hand moves",
    MARKER_HIDDEN: "the marker is not seen where it must be in view",
    SECOND_MARKER: "the hand's marker is in the picture more than once",
    MIRRORED_MARKER: "the marker's pose is the mirror image of what the wires tell",
    COMMAND_LATE: "the wires pull as older commands would have it",
    PUSHED: "tensions and gravity do not balance: something pushes the hand",
}
"""Every kind of fault that is named, and what it means."""


class Fault(NamedTuple):
    """One fault that is seen now.

    Attributes:
        kind: a key of `KINDS`.
        where: the muscle, "camera", "marker", "commands" or "hand".
        since: when it was noticed [s].
    """

    kind: str
    where: str
    since: float


def faults_for_info(faults: list[Fault]) -> list[dict[str, Any]]:
    """Faults as the entry ``faults`` of an ``info``: plain dictionaries."""
    return [fault._asdict() for fault in faults]


@dataclass(frozen=True)
class MotorControl:
    """Muscle stiffness control as the motors do it: T = bias + max(0, stiffness (l - l_target)).

    Attributes:
        stiffness: K_stiff [N/m].
        bias: T_bias [N].
        limit: the largest tension that may be commanded [N].

    Raises:
        AgentError: a number that is not positive and finite, or a bias above the limit.
    """

    stiffness: float = 30_000.0
    bias: float = 30.0
    limit: float = 500.0

    def __post_init__(self) -> None:
        for name in ("stiffness", "bias", "limit"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise AgentError(
                    f"MotorControl: {name} is {getattr(self, name)}, but must be positive and "
                    "finite."
                )
        if self.bias > self.limit:
            raise AgentError(
                f"MotorControl: bias {self.bias} N is above the limit of {self.limit} N."
            )

    def demanded(self, lengths: Floats, target_lengths: Floats) -> Floats:
        """Tension [N] that the control demands at lengths for target lengths [m], of any shape."""
        return self.bias + self.stiffness * np.maximum(0.0, lengths - target_lengths)

    def shortest_target(self, lengths: Floats) -> Floats:
        """The target lengths [m] that demand the limit at given lengths [m]."""
        return lengths - (self.limit - self.bias) / self.stiffness
