"""A robot of another size than Kengoro's: muscles as springs, no inertia, and channels with faults.

Its map departs from the nominal one, its clock jitters and pauses, and its motors are weak.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jmm_agent.commissioning.commissioning import Commissioner, Commissioning
from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.group_map import GroupMap
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats

JOINTS, COUNT = ("a", "b", "c"), 12
MUSCLES = tuple(f"muscle_{number}" for number in range(COUNT))
LIMITS = np.array([[-0.8, 0.8], [-0.7, 0.9], [-1.0, 0.6]])
START = np.array([0.1, -0.1, -0.2])
MOTORS = MotorControl(stiffness=9000.0, bias=3.0, limit=40.0)
HIDDEN = 16
MOVES = 2
"""Steps in which the robot moves in a control period."""


def nominal_map(seed: int = 0) -> JointMuscleMap:
    """A random map; lengths of some 5 mm, as of a small hand."""
    rng = np.random.default_rng([seed, 4])
    group = GroupMap(
        "all",
        np.arange(len(JOINTS)),
        np.arange(COUNT),
        np.zeros(len(JOINTS)),
        np.ones(len(JOINTS)),
        rng.normal(size=(HIDDEN, len(JOINTS))),
        0.3 * rng.normal(size=HIDDEN),
        9.0 * rng.normal(size=(COUNT, HIDDEN)),
        np.zeros(COUNT),
    )
    return JointMuscleMap(JOINTS, MUSCLES, (group,))


def departed(jmm: JointMuscleMap, seed: int, share: float = 0.15) -> JointMuscleMap:
    """A map whose moment arms differ by some 15 %."""
    rng = np.random.default_rng([seed, 5])
    (group,) = jmm.groups
    other = group.W2 * (1.0 + share * rng.standard_normal(group.W2.shape))
    return replace(jmm, groups=(replace(group, W2=other),))


class SpringRobot:
    """The robot, as a driver.

    Args:
        seed: of departures, noise and clock.
        period: mean control period [s].

    Attributes:
        commands, lengths, tensions: muscle of each channel (m,).
        command_factors, length_factors, tension_factors: of each channel (m,).
        absent: muscles that hold nothing (m,).
        dead: motors that do nothing (m,).
        written: all commands.
        stopped: number of calls of `stop`.
    """

    def __init__(self, seed: int = 0, period: float = 0.013) -> None:
        self.map = departed(nominal_map(), seed)
        self._rng, self._period = np.random.default_rng([seed, 6]), period
        order, ones = np.arange(COUNT), np.ones(COUNT)
        self.commands, self.lengths, self.tensions = (order.copy() for _ in range(3))
        self.command_factors, self.length_factors, self.tension_factors = (
            ones.copy() for _ in range(3)
        )
        self.absent, self.dead = np.zeros((2, COUNT), dtype=bool)
        self.q, self.offset = START.copy(), 0.001 * self._rng.standard_normal(COUNT)
        self.target = self.map.lengths(self.q)
        self.drum = self.target.copy()
        self.time, self._steps = 1.7e9, 0
        self.written: list[Floats] = []
        self.largest, self.stopped = 0.0, 0

    def _tensions(self, lengths: Floats) -> Floats:
        pull = MOTORS.demanded(lengths, self.target)
        pull = np.minimum(pull, MOTORS.limit)
        return np.where(self.absent | self.dead, 0.0, pull)

    def _move(self, seconds: float) -> None:
        for _ in range(MOVES):
            lengths, arms = self.map.lengths_and_jacobian(self.q)
            tensions = self._tensions(lengths)
            stiff = arms[tensions > MOTORS.bias]
            stiffness = MOTORS.stiffness * (stiff.T @ stiff) + 0.3 * np.eye(len(JOINTS))
            step = np.linalg.solve(stiffness, arms.T @ tensions)
            share, most = 1.0 - np.exp(-seconds / MOVES / 0.03), 0.12 / MOVES
            self.q = np.clip(self.q - share * np.clip(step, -most, most), *LIMITS.T)

    def read(self) -> SensorReadings:
        """Run a control period; some are late, and one pauses."""
        self._steps += 1
        seconds = self._period * self._rng.uniform(0.4, 1.6)
        self._move(seconds)
        self.time += seconds + (0.9 if self._steps == 400 else 0.0)
        lengths = self.map.lengths(self.q)
        self.drum = np.where(self.absent, self.target, lengths)
        tensions = self._tensions(lengths)
        self.largest = max(self.largest, float(tensions.max()))
        noise = 2e-5 * self._rng.standard_normal(COUNT)
        lengths = (self.drum + noise)[self.lengths] * self.length_factors
        tensions = tensions + 0.05 * self._rng.standard_normal(COUNT)
        tensions = tensions[self.tensions] * self.tension_factors
        return SensorReadings(self.time, lengths, tensions)

    def write(self, target_lengths: Floats) -> None:
        """Command the channels."""
        self.written.append(target_lengths.copy())
        self.target = np.empty(COUNT)
        self.target[self.commands] = target_lengths * self.command_factors

    def stop(self) -> None:
        """Count the call."""
        self.stopped += 1

    @property
    def held(self) -> Floats:
        """What the channels hold now."""
        return np.asarray((self.target / self.command_factors)[self.commands])


def run(robot: SpringRobot, held: bool = True) -> Commissioning:
    """A commissioning run, step by step."""
    start = START + np.array([0.15, -0.1, 0.12])
    given = robot.held if held else None
    commissioner = Commissioner(nominal_map(), LIMITS, start, MOTORS, held=given)
    for _ in range(20_000):
        robot.write(commissioner.step(robot.read()))
        if commissioner.done:
            return commissioner.result()
    raise AssertionError("the run does not end")
