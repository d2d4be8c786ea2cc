"""Force limits of motors: the nominal one, and one that a model states for the actuator."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.support import machine_size
from reality_gap.study.system import System


def nominal_limit(system: System, actuator: str) -> float:
    """Return the nominal limit of a motor's force, or that of its element if lower; 0 without."""
    model, index = system.model, system.model.actuator(actuator).id
    element, limits = int(model.actuator_trnid[index, 0]), list[float]()
    if own := float(machine_size.machine_size(system).limit[index]):
        limits.append(own)
    if int(model.actuator_trntype[index]) == int(mujoco.mjtTrn.mjTRN_TENDON):
        limited, widest = model.tendon_actfrclimited[element], model.tendon_actfrcrange[element]
    else:
        limited, widest = model.jnt_actfrclimited[element], model.jnt_actfrcrange[element]
    if limited:
        most = float(np.max(np.abs(widest)))
        limits.append(most / abs(float(model.actuator_gear[index, 0])))
    return min(limits, default=0.0)


def limit_force(spec: mujoco.MjSpec, system: System, actuator: str) -> None:
    """Write the nominal limit into a motor that only its element or its command limits."""
    if not system.model.actuator(actuator).forcelimited[0]:
        element, limit = spec.actuator(actuator), nominal_limit(system, actuator)
        if element.forcelimited != mujoco.mjtLimited.mjLIMITED_TRUE:
            element.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            element.forcerange = np.array([-limit, limit])
