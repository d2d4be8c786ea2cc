"""Scales of a robot, from which the options of its agent and its guard derive.

The defaults of all options are those of Kengoro's arm. `RobotScales` holds what another robot
differs in: how far its muscles move, how far its joints turn, how far its hand moves in the view of
its camera, how its marker appears there, and its motors. `SCALED` says which option follows which
of them. An option of another robot is the default times the ratio of both robots, unless it was
given: an option that differs from its default stays as it is.

Ratios are rounded to `DIGITS` significant digits, so that rounding errors of another computer
change no option, and Kengoro's arm keeps the defaults to the bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.guard.guard import GuardOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.nominal_model import NominalModel
from jmm_agent.options import AgentOptions
from jmm_agent.vision.camera import Camera

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SAMPLES = 200
"""Number of postures, uniform between the joint limits, over which scales are taken."""
DIGITS = 3
"""Significant digits of the ratio of a robot to Kengoro's arm."""
STILL = 1e-6
"""Movement of the marker that counts as none, as a share of its distance [1]."""

SCALED: Mapping[str, Mapping[str, str]] = {
    "AgentOptions": {"arrival": "angle", "map_rate": "length"},
    "PriorOptions": {
        "offset": "length",
        "shape": "length",
        "noise": "length",
        "elongation": "length",
        "zeroing": "length",
        "zero_posture": "angle",
        "zeroed_offset": "length",
        "zeroed_shape": "length",
        "points": "length",
        "remaining_shape": "length",
    },
    "FeedbackOptions": {"most": "angle"},
    "TensionOptions": {"length_error": "length"},
    "BatchOptions": {"rehearsal_noise": "length", "zero_noise": "length"},
    "SettlingOptions": {"change": "length", "release": "length"},
    "AntagonismOptions": {"distance": "posture", "noise": "length"},
    "VisionOptions": {
        "distance": "posture",
        "threshold": "posture",
        "noise": "length",
        "saturation": "tension",
        "stop_margin": "angle",
        "position_residual": "position",
        "rotation_residual": "orientation",
    },
    "ObservationFitOptions": {
        "position_noise": "position",
        "rotation_noise": "orientation",
        "tolerance": "angle",
        "limit_margin": "angle",
    },
    "CameraPrior": {"position": "reach"},
    "JointPrior": {"offset": "reach"},
    "BalanceOptions": {"arm": "moment arm", "noise": "torque", "stop_margin": "angle"},
    "HoldOutOptions": {"noise": "length"},
    "EstimatorOptions": {
        "encoder_noise": "length",
        "motion_noise": "angle",
        "process_noise": "angle",
        "initial_std": "angle",
        "invalidation_std": "angle",
        "limit_margin": "angle",
    },
    "MuscleMonitorOptions": {
        "quiet": "length",
        "speed": "length",
        "offset": "length",
        "wound_up": "length",
    },
    "DelayMonitorOptions": {"least": "tension"},
    "DisturbanceMonitorOptions": {"least": "force", "usual_change": "force"},
    "CameraMonitorOptions": {"moved": "length", "still_m": "reach", "follows_m": "reach"},
}
"""Ratio (a key of `RobotScales.ratios`) that each option follows, by record and option."""

Record = TypeVar("Record", bound="DataclassInstance")


@dataclass(frozen=True)
class RobotScales:
    """Scales of a robot; the defaults are those of Kengoro's arm.

    Attributes:
        travel: how far muscles move between the joint limits: median over muscles of the standard
            deviation of the length [m].
        joint_range: median range of a joint [rad].
        posture_range: L2 norm of the ranges of all joints [rad].
        reach: how far the hand's marker moves in the camera's frame: root mean square distance
            from its mean position [m].
        distance: median distance of the marker from the camera [m].
        marker_side: of the hand's marker [m].
        focal: focal length of the camera [px].
        motors: gains and limit of the motors.

    Raises:
        AgentError: a scale is not positive and finite.
    """

    travel: float = 0.0211088
    joint_range: float = 1.26536
    posture_range: float = 5.65753
    reach: float = 0.425236
    distance: float = 0.53319
    marker_side: float = 0.05
    focal: float = 579.411
    motors: MotorControl = field(default_factory=MotorControl)

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name != "motors" and not 0.0 < value < np.inf:
                raise AgentError(
                    f"RobotScales: {entry.name} is {value}, but must be positive and finite."
                )

    @property
    def marker_pixels(self) -> float:
        """Side of the marker in the image at the median distance [px]."""
        return self.focal * self.marker_side / self.distance

    @property
    def force(self) -> float:
        """Force on the hand that the largest tension balances [N], about."""
        return self.motors.limit * self.travel / (self.joint_range * self.reach)

    @property
    def ratios(self) -> dict[str, float]:
        """Ratio of each scale to that of Kengoro's arm [1].

        Marker poses are no better than the image: a pixel more in the marker's side is a distance
        of ``distance / marker_pixels``, and an angle of ``1 / marker_pixels``, about.
        """
        other = RobotScales()
        pixels = self.marker_pixels / other.marker_pixels
        depth = self.distance / self.marker_pixels / (other.distance / other.marker_pixels)
        reach = self.reach / other.reach
        arm = self.travel / self.joint_range / (other.travel / other.joint_range)
        ratios = {
            "length": self.travel / other.travel,
            "angle": self.joint_range / other.joint_range,
            "posture": self.posture_range / other.posture_range,
            "reach": reach,
            "position": max(reach, depth),
            "orientation": max(1.0, 1.0 / pixels),
            "tension": self.motors.limit / other.motors.limit,
            "moment arm": arm,
            "torque": self.motors.limit / other.motors.limit * arm,
            "force": self.force / other.force,
        }
        return {name: float(f"{ratio:.{DIGITS}g}") for name, ratio in ratios.items()}

    def agent_options(self, given: AgentOptions | None = None) -> AgentOptions:
        """Options of an agent of this robot.

        Args:
            given: options; those that differ from their defaults stay as they are.
        """
        return scaled(given or AgentOptions(), self.ratios)

    def guard_options(self, given: GuardOptions | None = None) -> GuardOptions:
        """Options of a guard of this robot.

        Args:
            given: options; those that differ from their defaults stay as they are.
        """
        return scaled(given or GuardOptions(), self.ratios)


def robot_scales(
    nominal: NominalModel,
    kinematics: ArmKinematics,
    camera: Camera,
    marker_side: float,
    motors: MotorControl,
    options: AgentOptions | None = None,
) -> RobotScales:
    """Scales of a robot by its nominal model.

    Args:
        nominal: names, limits and muscle lengths.
        kinematics: of the same joints.
        camera: the camera that the frames come from.
        marker_side: of the hand's marker [m].
        motors: gains and limit of the motors.
        options: name the frames of camera and marker. Without a camera the scales of its image are
            those of Kengoro's arm, and the reach is that in the world.

    Raises:
        KinematicsError: the kinematics have no such frame.
        AgentError: no joint moves the marker in the camera's frame.
    """
    options = options or AgentOptions()
    rng = np.random.default_rng(0)
    postures = rng.uniform(nominal.lower, nominal.upper, (SAMPLES, len(nominal.joints)))
    ranges = nominal.upper - nominal.lower
    site, eye = options.marker_site, options.camera or None
    seen = np.array([kinematics.pose(site, q, relative_to=eye)[:3, 3] for q in postures])
    spread = np.linalg.norm(seen.std(axis=0))
    if spread <= STILL * np.abs(seen).max():
        raise AgentError(
            f"No joint moves the marker {site!r} in the frame of {eye or 'the world'}: nothing can "
            "be learned from its poses. Name a site that the muscles move."
        )
    scales = RobotScales(
        travel=float(np.median(nominal.lengths(postures).std(axis=0))),
        joint_range=float(np.median(ranges)),
        posture_range=float(np.linalg.norm(ranges)),
        reach=float(spread),
        distance=float(np.median(np.linalg.norm(seen, axis=1))),
        marker_side=marker_side,
        focal=float(camera.fy),
        motors=motors,
    )
    if eye is not None:
        return scales
    default = RobotScales()
    return replace(
        scales, distance=default.distance, marker_side=default.marker_side, focal=default.focal
    )


def scaled(options: Record, ratios: Mapping[str, float]) -> Record:
    """Options of a robot: every scaled option that has its default, times its ratio.

    Args:
        options: a dataclass of options, with further ones in its fields.
        ratios: as `RobotScales.ratios`.
    """
    return _scaled(options, type(options)(), ratios)


def _scaled(options: Record, usual: Record, ratios: Mapping[str, float]) -> Record:
    """As `scaled`, with the values of options that were not given.

    The record that holds a record may have other defaults for it than its type has.
    """
    changes: dict[str, Any] = {}
    table = SCALED.get(type(options).__name__, {})
    for option in fields(options):
        value, default = getattr(options, option.name), getattr(usual, option.name)
        if is_dataclass(value) and not isinstance(value, type):
            same = type(default) is type(value)
            changes[option.name] = _scaled(value, default if same else type(value)(), ratios)
        elif option.name in table and value == default:
            changes[option.name] = value * ratios[table[option.name]]
    return replace(options, **changes)
