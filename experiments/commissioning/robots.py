"""Robots of a commissioning run: which they are, what is wrong with them, and how they answer."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import radians
from pathlib import Path

import numpy as np

from experiments.other_robots.machine import Departures
from experiments.other_robots.models import SIDES, write_model
from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro.agents import scales_of
from kengoro.nominal_robot import NominalRobot
from kengoro.robots import arm_scene, sample_within, shuffled_postures
from kengoro.trained_maps import map_of
from kengoro_env.assets import asset_path
from kengoro_env.departures import DryFriction, Elongation, TendonStretch, ZeroPosture, actual
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.robot import Robot

ARM, FAR_ARM, ELBOW = "arm", "far-arm", "elbow"
ROBOTS = (ARM, FAR_ARM, ELBOW, "planar-finger", "docs-arm")
"""Kengoro's arm, the same with three times the departures, its elbow, and other robots."""
FACTOR = 3.0
"""By how much the departures of `FAR_ARM` are larger [1]."""
BROKEN = 10.0
"""Elongation of a muscle that holds nothing [m]."""
SLACK = 0.3
"""Elongation of a slack muscle, as a share of the travel [1]."""

FAULTS = (
    "none", "swapped", "three-swapped", "motors-swapped", "encoders-swapped", "tensions-swapped",
    "reversed", "encoder-reversed", "tension-reversed", "absent", "motor-dead", "slack",
    "tension-dead", "tension-scale", "encoder-stuck", "encoder-scale",
)  # fmt: skip
"""Names of the faults."""


@dataclass
class Connection:
    """What the channels of a robot are connected to; all arrays are (m,).

    Attributes:
        commands, lengths, tensions: muscle of each channel.
        signs: of the commands.
        length_factors, tension_factors: of the readings.
        stuck: channel whose encoder is stuck; -1: none.
    """

    commands: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    signs: Floats
    length_factors: Floats
    tension_factors: Floats
    stuck: int = -1
    stuck_at: float = field(default=np.nan)


@dataclass(frozen=True)
class Fault:
    """A fault of a robot.

    Attributes:
        name: one of `FAULTS`.
        kind: that a commissioning run should name; empty for none.
        channels: that it should name.
        factor: of a scale.
    """

    name: str
    kind: str
    channels: tuple[int, ...]
    factor: float = 1.0


KINDS = {
    "none": "",
    "reversed": "reversed",
    "encoder-reversed": "reversed",
    "tension-reversed": "reversed",
    "absent": "absent",
    "motor-dead": "motor_dead",
    "slack": "slack",
    "tension-dead": "tension_sensor_dead",
    "tension-scale": "tension_scale",
    "encoder-stuck": "encoder_stuck",
    "encoder-scale": "encoder_scale",
}


def sample_fault(name: str, muscles: int, rng: np.random.Generator) -> Fault:
    """A fault of random muscles.

    Args:
        name: one of `FAULTS`.
        muscles: number of muscles.
        rng: samples them.
    """
    count = (
        0 if name == "none" else 3 if name.startswith("three") else 2 if "swapped" in name else 1
    )
    channels = tuple(int(each) for each in rng.choice(muscles, count, replace=False))
    factor = 1.0
    if name == "tension-scale":
        factor = float(rng.choice([0.1, 0.4, 2.5, 9.81, 1000.0]))
    if name == "encoder-scale":
        factor = float(rng.choice([0.001, 0.1, 0.4, 2.5, 10.0]))
    return Fault(name, KINDS.get(name, "swapped"), channels, factor)


class FaultyRobot:
    """A simulated robot with a fault, behind an interface of m channels.

    Args:
        scene: MJCF file of the nominal model.
        departures: of the robot.
        fault: what is wrong.
        start: joint angles (n,) [rad].
        seed: of the sensors' noise.
        travel: how far the muscles move [m].
    """

    def __init__(
        self,
        scene: Path,
        departures: tuple[Departure, ...],
        fault: Fault,
        start: Floats,
        seed: int,
        travel: float,
    ) -> None:
        names = NominalRobot(scene).arm.muscles
        first = fault.channels[0] if fault.channels else -1
        if fault.name in ("absent", "slack"):
            length = BROKEN if fault.name == "absent" else SLACK * travel
            departures = (*departures, Elongation(names[first], length, 0.01))
        self.robot = Robot(scene, departures)
        self.robot.reset(start, np.random.default_rng([seed, 6]))
        order, ones = np.arange(len(names)), np.ones(len(names))
        self._connection = Connection(
            order.copy(), order.copy(), order.copy(), ones.copy(), ones.copy(), ones.copy()
        )
        self._connect(fault)
        if fault.name == "slack":  # its motor does not wind it up by itself
            bias = self.robot.motors.bias.copy()
            bias[first] = 0.0
            self.robot.motors.set_stiffness(self.robot.motors.stiffness, bias)
        if fault.name == "motor-dead":
            number = self.robot.model.actuator(names[first]).id
            self.robot.model.actuator_gainprm[number] = 0.0
            self.robot.model.actuator_biasprm[number] = 0.0
            self.robot.model.actuator_forcerange[number] = (0.0, 1e-9)
        self._target = self.robot.target
        self._step = -1
        self._start = self.robot.joint_angles.copy()
        self.moved, self.pulled = 0.0, 0.0

    def _connect(self, fault: Fault) -> None:
        """Connect the channels as the fault demands."""
        connection, channels = self._connection, list(fault.channels)
        ring = channels[1:] + channels[:1]
        for part, names in (
            ("commands", ("swapped", "three-swapped", "motors-swapped")),
            ("lengths", ("swapped", "three-swapped", "encoders-swapped")),
            ("tensions", ("swapped", "three-swapped", "tensions-swapped")),
        ):
            if fault.name in names:
                getattr(connection, part)[channels] = ring
        if fault.name == "reversed":
            connection.signs[channels] = -1.0
        if fault.name in ("reversed", "encoder-reversed"):
            connection.length_factors[channels] = -1.0
        if fault.name == "encoder-scale":
            connection.length_factors[channels] = fault.factor
        if fault.name.startswith("tension-"):
            factors = {"tension-reversed": -1.0, "tension-dead": 0.0}
            connection.tension_factors[channels] = factors.get(fault.name, fault.factor)
        if fault.name == "encoder-stuck":
            connection.stuck = channels[0]

    @property
    def held(self) -> Floats:
        """Commands of the channels (m,) [m] that the motors hold at the start."""
        connection = self._connection
        return np.asarray(self.robot.target[connection.commands] * connection.signs)

    def read(self) -> SensorReadings:
        """Run one control period with the last command; the first call returns the start."""
        self._step += 1
        robot, connection = self.robot, self._connection
        if self._step:
            robot.step(self._target)
        self.moved = max(self.moved, float(np.abs(robot.joint_angles - self._start).max()))
        self.pulled = max(self.pulled, float(robot.tensions.max()))
        lengths = robot.measured_lengths()[connection.lengths] * connection.length_factors
        tensions = robot.measured_tensions()[connection.tensions] * connection.tension_factors
        if connection.stuck >= 0:
            if not np.isfinite(connection.stuck_at):
                connection.stuck_at = float(lengths[connection.stuck])
            lengths[connection.stuck] = connection.stuck_at
        return SensorReadings(self._step * robot.control_period, lengths, tensions)

    def write(self, target_lengths: Floats) -> None:
        """Command target lengths of the channels (m,) [m]."""
        connection = self._connection
        self._target = np.empty_like(target_lengths)
        self._target[connection.commands] = target_lengths * connection.signs

    def stop(self) -> None:
        """Hold the last command."""


def scene_of(robot: str, folder: Path) -> Path:
    """MJCF file of a robot.

    Args:
        robot: one of `ROBOTS`.
        folder: for files of other robots.
    """
    if robot == ELBOW:
        return Path(asset_path("mjcf/kengoro_arm/elbow.xml"))
    return Path(arm_scene()) if robot in (ARM, FAR_ARM) else write_model(robot, folder)


def departures_of(robot: str, scene: Path, seed: int) -> tuple[Departure, ...]:
    """Departures of a robot from its nominal model.

    Args:
        robot: one of `ROBOTS`.
        scene: its MJCF file.
        seed: of the samples.
    """
    if robot in (ARM, ELBOW):
        return actual(seed)
    if robot == FAR_ARM:
        return tuple(_farther(each) for each in actual(seed))
    nominal = NominalRobot(scene)
    scales, arm = scales_of(scene, marker_sides={0: SIDES[robot]}), nominal.arm
    ranges = dict(zip(arm.joints, arm.upper - arm.lower, strict=True))
    stiffness, limit = scales.motors.stiffness, scales.motors.limit
    return (
        Departures(scales, ranges, seed),
        TendonStretch(compliance=0.3 / stiffness),
        DryFriction(constant=0.002 * limit, ratio=0.02),
    )


def _farther(departure: Departure) -> Departure:
    """A departure that is `FACTOR` times as large; the zero posture is at most 30 deg off."""
    if isinstance(departure, ZeroPosture):
        return replace(departure, shoulder=radians(30.0), scapula=radians(20.0))
    names = ("sigma", "constant", "ratio", "offset", "noise", "compliance")
    larger = {name: FACTOR * getattr(departure, name) for name in names if hasattr(departure, name)}
    changed: Departure = replace(departure, **larger)  # type: ignore[type-var]
    return changed


def start_of(robot: str, scene: Path, seed: int) -> Floats:
    """Joint angles (n,) [rad] at which a robot is.

    Args:
        robot: one of `ROBOTS`.
        scene: its MJCF file.
        seed: of the samples.
    """
    if robot in (ARM, FAR_ARM):
        return shuffled_postures(seed)[0]
    return sample_within(NominalRobot(scene).arm, 1, seed)[0]


def map_and_motors(
    scene: Path, cache: Path | None
) -> tuple[JointMuscleMap, Floats, MotorControl, float]:
    """Nominal map, joint limits (n, 2) [rad], motors and travel [m] of a robot."""
    nominal = NominalRobot(scene)
    limits = np.column_stack([nominal.arm.lower, nominal.arm.upper])
    return map_of(nominal.model, cache), limits, nominal.motors(), nominal.arm.travel
