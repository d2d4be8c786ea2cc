"""Compare a step of MJX with one of MuJoCo; runs in an environment of its own, which has MJX.

Prints the largest difference of positions and velocities after one step from the model's initial
state, with commands of 0.2, as JSON.
"""

import json
import sys

import jax
import mujoco
import numpy as np
from mujoco import mjx

jax.config.update("jax_enable_x64", True)
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
data.ctrl[:] = 0.2
put = mjx.put_model(model)
there = mjx.step(put, mjx.put_data(model, data))
mujoco.mj_step(model, data)
differences = [
    float(np.abs(np.asarray(getattr(there, name)) - getattr(data, name)).max())
    for name in ("qpos", "qvel")
]
print(json.dumps({"largest": max(differences), "moved": float(np.abs(data.qvel).max())}))
