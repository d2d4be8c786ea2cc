"""Learn a robot of your own: from an MJCF file with tendons to an agent that learns the machine.

The machine is simulated here: one attachment point of a tendon lies 9 mm from where the nominal
model has it. A real machine answers through the same three methods. See docs/own_robot.md.
"""

from pathlib import Path

import numpy as np

import kengoro
from jmm_agent import SensorReadings, drive
from kengoro_env import Draft, HeadCamera, Painter, Robot

SCENE = Path(__file__).with_name("arm3.xml")


class MovedPoint:
    """What the machine has and the model lacks."""

    def edit(self, draft: Draft) -> None:
        site = draft.spec.site("lift_1")
        site.pos = np.add(site.pos, (0.0, 0.0, 0.009))


class Machine:
    """Driver of the machine: `jmm_agent.Driver`."""

    def __init__(self, start: np.ndarray) -> None:
        self.robot = Robot(SCENE, [MovedPoint()])
        self.robot.reset(start, np.random.default_rng(1))
        self.camera = HeadCamera(Painter(self.robot.model), delay=0.1)
        self.camera.reset(self.robot.data)
        self.command = self.robot.target

    def read(self) -> SensorReadings:
        """Run one control period and return the sensor readings after it."""
        self.robot.step(self.command)
        self.camera.update(self.robot.data)
        taken, frame = self.camera.newest()
        lengths, tensions = self.robot.measured_lengths(), self.robot.measured_tensions()
        return SensorReadings(self.robot.time, lengths, tensions, frame, taken)

    def write(self, target_lengths: np.ndarray) -> None:
        self.command = target_lengths

    def stop(self) -> None:
        self.command = self.robot.target


postures = kengoro.sample_postures(SCENE, 100)
agent = kengoro.make_agent(scene=SCENE, postures=postures, marker_sides={0: 0.05}, learning=False)
machine = Machine(postures[0])
for visit, posture in enumerate([*postures[:5], *postures[1:5]]):  # each again, once it has learned
    agent.go(posture, duration=1.0)
    drive(agent, machine, seconds=2.0)  # stops the machine if anything goes wrong
    error = np.degrees(np.abs(machine.robot.joint_angles - posture).max())
    print(f"visit {visit}: learning {agent.learning}, largest error {error:.2f} deg")
    agent.learning = visit >= 4
