"""Drive a robot in another process: the agent's side of a real robot's control loop.

`kengoro.RemoteRobot` has the three methods of `jmm_agent.Driver`: read, write, stop. Replace it by
the driver of your robot.
"""

import numpy as np

import kengoro
from jmm_agent import drive

POSTURES = 6

agent = kengoro.make_agent(seed=1)
with kengoro.robot_process("Posture", seed=1) as robot:
    for number, posture in enumerate(kengoro.shuffled_postures(seed=1)[:POSTURES]):
        before = agent.seen
        agent.go(posture, duration=2.0)
        drive(agent, robot, seconds=5.0)  # stops the robot if anything goes wrong
        if agent.seen is None or agent.seen is before:
            print(f"posture {number}: the hand's marker was not found")
        else:
            error = np.degrees(np.sqrt(np.mean(agent.seen.error**2)))
            print(f"posture {number}: {error:.1f} deg between estimated and observed joint angles")
