"""Dry friction of wires and joints.

As bristles that bend, then slide: MuJoCo's LuGre model, as an actuator without input. A wire in a
guide and a joint in its bearing move a little before they slip; ``frictionloss`` knows no such
motion, so that a replay sticks elsewhere than the machine does, and jumps with the size of the
friction. C. Canudas de Wit et al., "A new model for control of systems with friction", IEEE Trans.
Automatic Control 40 (1995), without Stribeck's effect. Where efforts are compared, or a sensor adds
up all actuators, it is ``frictionloss`` all the same.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Location, Parameter, SearchHints, Values
from reality_gap.causes.support import typical_scales
from reality_gap.causes.support.model_overrides import Extra
from reality_gap.causes.support.new_elements import add_actuator
from reality_gap.study.system import System
from reality_gap.types import Floats

SOLREF = (0.004, 1.0)
SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)
"""Friction that hardly creeps: MuJoCo's default lets a tenth of the force through at rest."""
STABLE = 0.1
"""Stiffness of a bristle times the squared time step, over the mass that it holds, at most."""
DAMPED = 1.25
"""Time constant of a bristle in time steps: its force is that of a step ago, and would buzz."""
SLOW = 1e-3
"""Stribeck's velocity; without effect, as friction at rest is that of sliding."""
SUMS = (int(mujoco.mjtSensor.mjSENS_TENDONACTFRC), int(mujoco.mjtSensor.mjSENS_JOINTACTFRC))
SLIDING, RESTING = 3, 4
"""Where an actuator's ``biasprm`` holds its friction."""
LEAST = 1e-3
"""Share of their force that bristles keep; MuJoCo's have a stiffness or are none."""
STIFFNESS, DAMPING = 5, 6
"""Where its ``dynprm`` holds those of the bristles."""


def bend(system: System, location: Location) -> Parameter:
    """The parameter of how far an element moves before it slips."""
    if location.kind == "tendon":
        return Parameter(
            "presliding", "m", 3e-5, 0.0, 3e-6, 1e-3, null=3e-5, hints=SearchHints(shape=True)
        )
    unit, travel = typical_scales.joint_travel(system, location)
    size = 3e-4 * travel
    return Parameter(
        "presliding",
        unit,
        size,
        0.0,
        0.1 * size,
        30 * size,
        null=size,
        hints=SearchHints(shape=True),
    )


def bend_in(values: Values, system: System, location: Location) -> float:
    """How far an element moves before it slips [m or rad]: as ``values`` say, or as usual."""
    return float(values.get("presliding", bend(system, location).null))


def possible(system: System) -> bool:
    """Whether friction may be an actuator's force."""
    kinds = {int(system.model.sensor(name).type[0]) for name in system.sensed}
    return not system.study.inverse and kinds.isdisjoint(SUMS)


def drawn(system: System, location: Location) -> bool:
    """Whether the study's model has dry friction in any of a place's tendons."""
    model = system.model
    tendons = [model.tendon(name).id for name in location.elements]
    motors = (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_DCMOTOR) & (
        model.actuator_biasprm[:, SLIDING] > 0.0
    )
    tied = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
    braked = model.actuator_trnid[motors & tied, 0]
    return bool(model.tendon_frictionloss[tendons].any() or np.isin(tendons, braked).any())


def brake(
    spec: mujoco.MjSpec,
    system: System,
    cause: str,
    location: Location,
    force: float,
    bend: float,
    lean: float = 0.0,
) -> None:
    """Add dry friction to all elements of a place.

    Args:
        spec: the model.
        system: the machine.
        cause: id of the cause.
        place: tendons or joints.
        force: friction [N or N m]; a hook may change it, see `Brakes`.
        bend: over which it builds up [m or rad].
        lean: constant force besides [N or N m]; only where friction may be an actuator's force.
    """
    tendon = location.kind == "tendon"
    if not possible(system):
        for name in location.elements:
            element = spec.tendon(name) if tendon else spec.joint(name)
            element.frictionloss = element.frictionloss + force
            element.solref_friction, element.solimp_friction = SOLREF, SOLIMP
        return
    kind = mujoco.mjtTrn.mjTRN_TENDON if tendon else mujoco.mjtTrn.mjTRN_JOINT
    step = float(system.model.opt.timestep)
    for name in location.elements:
        stiffness = min(force / bend, STABLE / (_lightness(system, location, name) * step**2))
        actuator = add_actuator(
            spec, name=_name(system, cause, location, name), trntype=kind, target=name
        )
        actuator.set_to_dcmotor(
            motorconst=[0.0, 0.0],
            resistance=1.0,
            lugre=[stiffness, DAMPED * step * stiffness, force, force, SLOW],
            cogging=[lean, 0.0, np.pi / 2 if lean else 0.0],  # without poles: the same everywhere
            ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
        )


def _lightness(system: System, location: Location, name: str) -> float:
    """One over the mass or inertia that moves with an element."""
    model = system.model
    if location.kind == "tendon":
        return float(model.tendon_invweight0[model.tendon(name).id])
    return float(model.dof_invweight0[model.joint(name).dofadr[0]])


def _name(system: System, cause: str, location: Location, element: str) -> str:
    """A name that no actuator of the study's model has; it may be one that was extended before."""
    group = "all" if len(location.elements) > 1 else ""
    name = "/".join(filter(None, (cause, location.note, group, element)))
    while mujoco.mj_name2id(system.model, mujoco.mjtObj.mjOBJ_ACTUATOR, name) >= 0:
        name += "'"
    return name


class Brakes:
    """The frictions that `brake` put on a place, for a hook that changes them at every step."""

    def __init__(
        self, model: mujoco.MjModel, system: System, cause: str, location: Location
    ) -> None:
        self._bristles: list[tuple[Extra, Floats]] = []
        self._bend: NDArray[np.int64] | None = None
        if possible(system):
            names = [_name(system, cause, location, element) for element in location.elements]
            at = np.array([model.actuator(name).id for name in names])
            self._bend = model.actuator_actadr[at]
            self._levels = [Extra(model.actuator_biasprm[:, k], at) for k in (SLIDING, RESTING)]
            for k in (STIFFNESS, DAMPING):
                cells = Extra(model.actuator_dynprm[:, k], at)
                self._bristles.append((cells, model.actuator_dynprm[at, k]))
        elif location.kind == "tendon":
            at = np.array([model.tendon(name).id for name in location.elements])
            self._levels = [Extra(model.tendon_frictionloss, at)]
        else:
            at = np.array([model.joint(name).dofadr[0] for name in location.elements])
            self._levels = [Extra(model.dof_frictionloss, at)]

    def ways(self, data: mujoco.MjData, velocity: Floats, creep: float) -> Floats:
        """Which way each element slides, or slid before it came to rest (k,), -1 to 1.

        A wire at rest still hangs on bristles that are bent the way it came. Where there are none,
        only the velocity tells.

        Args:
            data: the state.
            velocity: of the elements (k,).
            creep: velocity at which the way counts as clear.
        """
        if self._bend is not None:
            return np.sign(data.act[self._bend])
        return np.tanh(velocity / creep)

    def press(self, force: float, factor: float | Floats) -> None:
        """Press bristles that were given ``force`` [N] so many times harder, one number or (k,)."""
        factor = np.maximum(factor, LEAST)
        for cells in self._levels:
            cells.write(force * (factor - 1.0))
        for cells, usual in self._bristles:
            cells.write(usual * (factor - 1.0))
