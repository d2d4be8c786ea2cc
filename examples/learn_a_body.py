"""Learn a body: an agent that knows the nominal model learns an actual robot from its own hand.

Prints the error between commanded and true joint angles before and after learning.
"""

import numpy as np

import kengoro

POSTURES = 12  # 27 as in the paper take a minute

env = kengoro.make_env("Posture", robot_seed=1, max_episode_steps=100_000)
agent = kengoro.make_agent(seed=1, guard=True)
postures = kengoro.shuffled_postures(seed=1)
session = kengoro.Session(env, agent, seed=1, options={"posture": postures[-1]})

for number, posture in enumerate(postures[:POSTURES]):
    session.move(posture, duration=2.0, patience=2.0)  # move, settle, observe the hand, learn
    error = np.degrees(np.sqrt(np.mean((posture - session.truth["joint_angles"]) ** 2)))
    print(f"posture {number}: RMSE_joint {error:.1f} deg, faults {session.truth['faults']}")

agent.map.save("learned_map.npz")
env.close()
