"""Faults of the robot that a guard names, and the motor control that it assumes.

Each monitor finds one kind of symptom in the sensor readings: `muscle_monitor` those of encoders,
tension sensors and muscles, `camera_monitor` those of the camera and the hand, `motion_monitor`
late commands and pushes. The `guard` runs them all.
"""

from __future__ import annotations

from dataclasses import dataclass, field
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
HAND_HIDDEN = "hand_hidden"
SECOND_HAND = "second_hand"
MIRRORED_HAND = "mirrored_hand"
OTHER_HAND = "other_hand"
COMMAND_LATE = "command_late"
PUSHED = "pushed"

KINDS = {
    ENCODER_DEAD: "the encoder's reading is not a finite number",
    ENCODER_STUCK: "the encoder's reading no longer changes, not even by its noise",
    ENCODER_JUMP: "the encoder's reading jumped farther than a muscle can move",
    TENSION_SENSOR_DEAD: "the tension sensor reads nothing, but the muscle moves as expected",
    MUSCLE_SNAPPED: "the muscle has no tension, and its motor winds it up",
    CAMERA_FROZEN: "no new frame arrives, or frames stay the same while the hand moves",
    MARKER_HIDDEN: "the marker is not found where it must be in view",
    SECOND_MARKER: "the hand's marker is in the frame more than once",
    MIRRORED_MARKER: "the marker's pose is the mirror image of the predicted one",
    HAND_HIDDEN: "the hand is not found where it must be in view",
    SECOND_HAND: "another hand in the frame could be the own one",
    MIRRORED_HAND: "the hand in the frame is a mirror image",
    OTHER_HAND: "the hand in the frame does not move with the arm: it is another one, or a picture",
    COMMAND_LATE: "the tensions are those that older commands demand",
    PUSHED: "tensions and gravity do not balance: an external force acts on the hand",
}
"""All kinds of faults that a guard finds, and the meaning of each."""


CLOCK_JUMPED = "clock_jumped"
STAMPS_SKIPPED = "stamps_skipped"
NEVER_SETTLED = "never_settled"
NO_FRAME = "no_frame"
NOTHING_LEARNED = "nothing_learned"
HAND_NOT_FREE = "hand_not_free"
MUSCLE_LEFT_OUT = "muscle_left_out"
POSTURE_NOT_HELD = "posture_not_held"
ZEROED = "zeroed"
JOINT_CONTRADICTED = "joint_contradicted"
LENGTHS_WRONG = "lengths_wrong"
TRACKER_CLOCK = "tracker_clock"
TENSIONS_WRONG = "tensions_wrong"
HEAT_CHANGED = "heat_changed"
HEAT_LIMITED = "heat_limited"
TEMPERATURE_MISSING = "temperature_missing"
TEMPERATURE_WRONG = "temperature_wrong"
MUSCLES_SWAPPED = "muscles_swapped"
MUSCLE_REVERSED = "muscle_reversed"
MUSCLE_ABSENT = "muscle_absent"
MUSCLE_UNSTABLE = "muscle_unstable"
TENSION_LIMIT = "tension_limit"
LENGTHS_DRIFT = "lengths_drift"
JOINTS_MISPLACED = "joints_misplaced"

AGENT_KINDS = {
    CLOCK_JUMPED: "time stamps jumped: the clock was set, or readings paused",
    STAMPS_SKIPPED: "readings are skipped, because their time stamps are not later than others",
    NEVER_SETTLED: "the muscle lengths do not settle, so that nothing is learned",
    NO_FRAME: "no frame was taken during the rests, so that no marker observation is learned from",
    NOTHING_LEARNED: "none of the last marker observations was learned from",
    HAND_NOT_FREE: "the hand is not free for long, so that nothing is learned",
    JOINT_CONTRADICTED: "a joint's encoder and the muscle lengths contradict each other by the map",
    LENGTHS_WRONG: "muscle lengths have another unit or sign than the map's",
    TRACKER_CLOCK: "the times of measured poses are not on the clock of the readings",
    TENSIONS_WRONG: "tensions do not balance the loads of the model, and are not learned from",
    HEAT_CHANGED: "a motor heats or cools otherwise than it was learned: its cooling failed, or so",
    HEAT_LIMITED: "the tension of a muscle is limited, because its motor is hot",
    TEMPERATURE_MISSING: "the housing's temperature is not measured: the core is known less well",
    TEMPERATURE_WRONG: "the housing's temperature is far from what the thermal model allows",
    MUSCLE_LEFT_OUT: "the muscle is out of use, because somebody has left it out",
    POSTURE_NOT_HELD: "muscles in use cannot hold a wanted posture, and the arm goes to another",
    MUSCLES_SWAPPED: "two muscles are exchanged: each reads and moves the path of the other",
    MUSCLE_REVERSED: "the lengths of a muscle have the wrong sign, and it is left out",
    MUSCLE_ABSENT: "a muscle does not follow the joints, because it is absent or slack; left out",
    MUSCLE_UNSTABLE: "a muscle was elongated again and again, and is left out",
    TENSION_LIMIT: "the tension of a muscle stays at its limit, and the motion is stopped",
    JOINTS_MISPLACED: "bones or joint axes are not those of the model, so that hands miss",
    LENGTHS_DRIFT: "the muscle lengths drift, so that what was learned holds for a short time",
    ZEROED: "all muscle lengths differ from those remembered: they were zeroed anew",
}
"""Kinds of faults that any agent names, also without a guard, and the meaning of each."""


class Fault(NamedTuple):
    """One fault that is found now.

    Attributes:
        kind: a key of `KINDS` or `AGENT_KINDS`.
        where: the muscle or joint, "camera", "marker", "commands", "hand", "clock", "observations",
            "tracker" or "muscles".
        since: when it was noticed, on the agent's own time [s].
        detail: what was found, in a sentence; may be empty.
    """

    kind: str
    where: str
    since: float
    detail: str = ""


def faults_for_info(faults: list[Fault]) -> list[dict[str, Any]]:
    """Faults as plain dictionaries, for the entry ``faults`` of a Gymnasium ``info``.

    Args:
        faults: to convert.
    """
    return [fault._asdict() for fault in faults]


@dataclass(frozen=True)
class MotorControl:
    """Muscle stiffness control: T = bias + max(0, stiffness (l - l_target)) (sec. III-B).

    Attributes:
        stiffness: K_stiff [N/m].
        bias: T_bias [N].
        limit: largest tension that may be commanded [N].
        each: K_stiff of each muscle (m,) [N/m], where they differ from the common one; None if not.
            It does not count when two are compared.

    Raises:
        AgentError: a number is not positive and finite, or the bias is above the limit.
    """

    stiffness: float = 30_000.0
    bias: float = 30.0
    limit: float = 500.0
    each: Floats | None = field(default=None, compare=False)

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
        if self.each is not None and not np.all((self.each > 0.0) & (self.each < np.inf)):
            raise AgentError(
                f"MotorControl: each is {self.each}, but must be positive and finite numbers."
            )

    @property
    def gains(self) -> float | Floats:
        """K_stiff of all muscles, or of each (m,) [N/m]."""
        return self.stiffness if self.each is None else self.each

    def demanded(self, lengths: Floats, target_lengths: Floats) -> Floats:
        """Tensions that the control demands.

        Args:
            lengths: measured muscle lengths [m], of any shape.
            target_lengths: [m], of a shape that broadcasts with the lengths.

        Returns:
            Tensions [N], not limited.
        """
        return self.bias + self.gains * np.maximum(0.0, lengths - target_lengths)

    def shortest_target(self, lengths: Floats, limits: Floats | None = None) -> Floats:
        """Target lengths that demand the limit.

        Args:
            lengths: measured muscle lengths [m], of any shape.
            limits: tensions of the muscles that replace the limit [N]; None for the limit.

        Returns:
            Target lengths [m].
        """
        limit = self.limit if limits is None else limits
        return lengths - (limit - self.bias) / self.gains
