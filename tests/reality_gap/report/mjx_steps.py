"""Steps models by MuJoCo and by MJX from the same states; prints the largest differences as JSON.

``python mjx_steps.py MODEL.xml...``, in an environment that has the package ``mujoco-mjx``. States
are random and in motion. A difference is that of joint positions and of velocities [rad, rad/s],
relative to the largest velocity where that is above 1.
"""

from __future__ import annotations

import json
import sys

import jax
import mujoco
import numpy as np
from mujoco import mjx

STATES = 5
"""Number of states of each model."""


def largest_difference(path: str) -> dict[str, float]:
    """Of one step by both engines, and the least change of the velocities by it."""
    model = mujoco.MjModel.from_xml_path(path)
    step, mx = jax.jit(mjx.step), mjx.put_model(model)
    differences, changes = [], []
    for seed in range(STATES):
        rng, data = np.random.default_rng(seed), mujoco.MjData(model)
        data.qpos[:] += 0.05 * rng.standard_normal(model.nq)
        data.qvel[:] = rng.standard_normal(model.nv)
        data.ctrl[:] = rng.uniform(0.15, 0.25, model.nu)
        before, other = data.qvel.copy(), mjx.put_data(model, data)
        mujoco.mj_step(model, data)
        other = step(mx, other)
        changes.append(np.abs(data.qvel - before).max())
        scale = max(1.0, np.abs(data.qvel).max())
        off = np.array(other.qvel) - data.qvel, np.array(other.qpos) - data.qpos
        differences.append(max(np.abs(off[0]).max() / scale, np.abs(off[1]).max()))
    return {"difference": float(max(differences)), "change": float(min(changes))}


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    print(json.dumps([largest_difference(path) for path in sys.argv[1:]]))
