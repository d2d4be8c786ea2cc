"""Departures of the sensors: encoders, tension sensors and zero posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kengoro_env.names import GROUP_JOINTS
from kengoro_env.robot.draft import Draft


@dataclass(frozen=True)
class EncoderError:
    """Errors of the motors' encoders.

    Attributes:
        offset: standard deviation of each muscle's constant offset [m].
        noise: standard deviation of each reading [m].
        quantum: smallest step of a reading [m].
        seed: seed of the offsets.
    """

    offset: float = 0.0
    noise: float = 0.0
    quantum: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Write offsets, noise and quantum into the sensor errors."""
        if self.offset > 0.0:
            rng = np.random.default_rng([self.seed, 102])
            draft.sensor_errors.length_offset = {
                muscle: self.offset * float(rng.standard_normal()) for muscle in draft.tendons
            }
        if self.noise > 0.0:
            draft.sensor_errors.length_noise = self.noise
        if self.quantum > 0.0:
            draft.sensor_errors.length_quantum = self.quantum


@dataclass(frozen=True)
class TensionSensorError:
    """Errors of the tension sensors.

    Attributes:
        noise: standard deviation of each reading [N].
        offset: standard deviation of each muscle's constant offset [N].
        seed: seed of the offsets.
    """

    noise: float = 0.0
    offset: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Write noise and offsets into the sensor errors."""
        if self.noise > 0.0:
            draft.sensor_errors.tension_noise = self.noise
        if self.offset > 0.0:
            rng = np.random.default_rng([self.seed, 103])
            draft.sensor_errors.tension_offset = {
                muscle: self.offset * float(rng.standard_normal()) for muscle in draft.tendons
            }


@dataclass(frozen=True)
class ZeroPosture:
    """Error of the posture in which the lengths were zeroed.

    A person zeroes the lengths of a hanging arm, whose elbow is then slightly bent and whose upper
    arm is slightly off the body: the errors of elbow and shoulder roll have that sign, those of
    other joints either sign. Each angle lies between 0.5 and 1.5 times the value given.

    Attributes:
        shoulder: angle of the shoulder and elbow joints [rad].
        scapula: angle of the joints of the scapula [rad].
        forearm: angle of the radioulnar joint and the wrist [rad].
        neck: angle of the joints of the neck, which is easier to set [rad].
        seed: seed of the posture.
    """

    shoulder: float = 0.0
    scapula: float = 0.0
    forearm: float = 0.0
    neck: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Sample the posture and write it into the sensor errors."""
        angle = {group: float(getattr(self, group)) for group in GROUP_JOINTS}
        if not any(angle.values()):
            return
        rng = np.random.default_rng([self.seed, 105])
        known = {joint.name for joint in draft.spec.joints}
        for group, joints in GROUP_JOINTS.items():
            for joint in joints:
                side = {"elbow": 1, "sh_roll": -1}.get(joint, int(rng.choice([-1, 1])))
                share = side * float(rng.uniform(0.5, 1.5))
                if joint in known:
                    draft.sensor_errors.zero_posture[joint] = share * angle[group]
