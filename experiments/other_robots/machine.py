"""Simulated machine that departs from its nominal model, and how an agent drives it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.observation import SensorReadings
from jmm_agent.scales import RobotScales
from jmm_agent.types import Floats
from kengoro_env.robot.draft import Draft
from kengoro_env.robot.robot import Robot
from kengoro_env.vision.head_camera import HeadCamera
from kengoro_env.vision.rendering import Painter

POINTS, OFFSETS = 0.15, 0.1
"""Standard deviation of displaced points and of offsets of the lengths, as shares of how far the
muscles move [1]."""
ZERO = 0.1
"""Standard deviation of the posture in which lengths are zeroed, as a share of each range [1]."""
NOISE = 0.005
"""Noise of the encoders, as a share of how far the muscles move [1]."""
TENSION_NOISE = 0.002
"""Noise of the tension sensors, as a share of the motors' limit [1]."""
DELAY = 0.1
"""Age of a frame when the agent gets it [s]."""


@dataclass(frozen=True)
class Departures:
    """What a machine has and its nominal model lacks, in proportion to its size.

    Attributes:
        scales: of the robot.
        ranges: of the joints by name [rad].
        seed: of the samples.
    """

    scales: RobotScales
    ranges: dict[str, float]
    seed: int

    def edit(self, draft: Draft) -> None:
        """Displace points of tendons, and write offsets, noise and the zero posture."""
        rng, travel = np.random.default_rng([self.seed, 35]), self.scales.travel
        names = {
            element.target.name
            for tendon in draft.spec.tendons
            if tendon.name in draft.tendons
            for element in tendon.path
            if element.type.name == "mjWRAP_SITE"
        }
        for site in draft.spec.sites:
            if site.name in names:
                site.pos = site.pos + POINTS * travel * rng.standard_normal(3)
        errors = draft.sensor_errors
        for muscle in draft.tendons:
            errors.length_offset[muscle] = OFFSETS * travel * rng.standard_normal()
        for joint, reach in self.ranges.items():
            errors.zero_posture[joint] = ZERO * reach * rng.standard_normal()
        errors.length_noise = NOISE * travel
        errors.tension_noise = TENSION_NOISE * self.scales.motors.limit


class Machine:
    """A simulated robot with a camera, at rest in a posture.

    Args:
        scene: MJCF file of the nominal model.
        departures: of the machine.
        start: joint angles (n,) [rad].
        seed: of the sensors' noise.
    """

    def __init__(self, scene: Path, departures: Departures, start: Floats, seed: int) -> None:
        self.robot = Robot(scene, [departures])
        self.robot.reset(start, np.random.default_rng(seed))
        self._camera = HeadCamera(Painter(self.robot.model), DELAY)
        self._camera.reset(self.robot.data)
        self._command = self.robot.target

    def move(self, agent: Agent, posture: Floats, duration: float, rest: float) -> Floats:
        """Let an agent move to a posture and rest.

        Args:
            agent: drives the machine.
            posture: joint angles (n,) [rad].
            duration: of the movement [s].
            rest: time after it [s].

        Returns:
            True joint angles (n,) [rad] in the end.
        """
        agent.go(posture, duration)
        for _ in range(round((duration + rest) / self.robot.control_period)):
            self._command = agent.step(self.readings())
            self.robot.step(self._command)
            self._camera.update(self.robot.data)
        return self.robot.joint_angles

    def readings(self) -> SensorReadings:
        """What the agent is given."""
        robot = self.robot
        taken, frame = self._camera.newest()
        lengths, tensions = robot.measured_lengths(), robot.measured_tensions()
        return SensorReadings(robot.time, lengths, tensions, frame, taken)

    def close(self) -> None:
        """Free the GL context."""
        self._camera.close()
