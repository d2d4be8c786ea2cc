"""Draft: a robot before it is compiled, which departures edit.

A MuJoCo ``MjSpec`` has no encoders, delays or motors on spools. A `Draft` holds the spec and
beside it the tendons and the sensor errors.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import mujoco

from kengoro_env.errors import UnknownNameError
from kengoro_env.robot.model_file import is_muscle
from kengoro_env.robot.motor_heat import HeatSpec
from kengoro_env.robot.muscle_law import Gains


@dataclass
class TendonSpec:
    """Departures of a tendon and its motor from the ideal; the defaults are the nominal model.

    Attributes:
        stiffness: (k1, k2, k3) of the elastic tendon, T = k1 x + k2 x^2 + k3 x^3 for a stretch
            x > 0 [N/m, N/m^2, N/m^3]; None: the tendon does not stretch.
        motor_inertia: inertia of the motor seen at the tendon [kg].
        friction: dry friction along the tendon without tension [N].
        friction_ratio: dry friction per tension [1].
        elongation: permanent elongation since the tendon was mounted [m].
        wraps: bones that the tendon wraps over: {index of the path's segment: (geom, side site)}.
    """

    stiffness: tuple[float, float, float] | None = None
    motor_inertia: float = 0.0
    friction: float = 0.0
    friction_ratio: float = 0.0
    elongation: float = 0.0
    wraps: dict[int, tuple[str, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class FrameTimes:
    """Errors of the frames' time stamps.

    Attributes:
        offset: constant error [s].
        jitter: standard deviation of each stamp's error [s].
        drift: how much faster than the robot's the camera's clock runs [1].
        seed: seed of the jitter.
    """

    offset: float = 0.0
    jitter: float = 0.0
    drift: float = 0.0
    seed: tuple[int, ...] = (0,)


@dataclass
class SensorErrors:
    """Errors of the sensors, the camera's timing and the zero posture.

    Attributes:
        length_offset: offset of the encoder by muscle [m].
        length_noise: standard deviation of an encoder reading [m].
        length_quantum: smallest step of an encoder reading [m]; 0: not quantised.
        tension_noise: standard deviation of a tension reading [N].
        tension_offset: offset of the tension sensor by muscle [N].
        frame_delay: age of the newest frame that the agent gets [s].
        frame_times: errors of the frames' time stamps.
        lens: distortion of the camera's lens k1, k2, p1, p2, k3 [1]; None: there is none.
        zero_posture: joint angles at which the lengths were zeroed, by joint [rad].
    """

    length_offset: dict[str, float] = field(default_factory=dict)
    length_noise: float = 0.0
    length_quantum: float = 0.0
    tension_noise: float = 0.0
    tension_offset: dict[str, float] = field(default_factory=dict)
    frame_delay: float = 0.0
    frame_times: FrameTimes = FrameTimes()
    lens: tuple[float, ...] | None = None
    zero_posture: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Event:
    """Permanent elongation of a tendon during an episode.

    Attributes:
        time: time of the elongation since the reset [s].
        muscle: name of the muscle.
        elongation: added length [m].
    """

    time: float
    muscle: str
    elongation: float


@dataclass
class Draft:
    """A robot before it is compiled.

    Attributes:
        spec: the MuJoCo model, at first the nominal model.
        tendons: tendons by muscle, in the order of the model.
        sensor_errors: errors of encoders, tension sensors, camera timing and zero posture.
        events: elongations during an episode.
        heat: motors that heat; None: they stay cold.
        own_gains: gains of each muscle, with arrays (m,) as values, if the model has its own
            actuators; None: actuators are added to it.
    """

    spec: mujoco.MjSpec
    tendons: dict[str, TendonSpec]
    sensor_errors: SensorErrors = field(default_factory=SensorErrors)
    events: list[Event] = field(default_factory=list)
    heat: HeatSpec | None = None
    own_gains: Gains | None = None

    @classmethod
    def of(cls, spec: mujoco.MjSpec) -> Draft:
        """A draft without departures on a copy of ``spec``."""
        muscles = [tendon.name for tendon in spec.tendons if is_muscle(tendon)]
        return cls(spec.copy(), {muscle: TendonSpec() for muscle in muscles})

    def tendon(self, muscle: str) -> TendonSpec:
        """The tendon of a muscle.

        Raises:
            UnknownNameError: there is no such muscle.
        """
        if muscle not in self.tendons:
            raise UnknownNameError("muscle", muscle, self.tendons)
        return self.tendons[muscle]


class Departure(Protocol):
    """A departure from the nominal model: a frozen dataclass with one method."""

    def edit(self, draft: Draft) -> None:
        """Write this departure into ``draft``; null parameters leave the draft as it is.

        An edit sets values. It does not scale values that it reads, so that a second edit of the
        same kind does not compound.
        """
