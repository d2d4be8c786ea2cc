"""Dry friction of tendons and joints, as MuJoCo's LuGre model in an actuator without input.

A tendon in a guide and a joint in its bearing move a little before they slip (presliding). MuJoCo's
``frictionloss`` has no presliding: such a replay sticks at other positions than the machine, and
its residual jumps with the size of the friction. The LuGre model is a spring of stiffness ``sigma_0
= F / d`` [N/m or N m/rad] that slips at the friction ``F`` [N or N m], where ``d`` is the
presliding distance [m or rad]:

    dz/dt = v - sigma_0 |v| z / F,    force = sigma_0 z + sigma_1 dz/dt

with the bristle deflection ``z``, the velocity ``v`` and the bristle damping ``sigma_1``. Static
and sliding friction are equal (no Stribeck effect). Source: C. Canudas de Wit et al., "A new model
for control of systems with friction", IEEE Trans. Automatic Control 40 (1995).

If efforts are compared by inverse dynamics, or if a sensor measures the sum of all actuators, an
actuator cannot represent friction and ``frictionloss`` is used instead.

Friction may also let an element creep instead: below a velocity ``creep`` its force is proportional
to the velocity. Simulations regularise dry friction in this way, and greased bearings do it too.
That is ``frictionloss``, whose solver parameters say how fast it creeps.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Location, Parameter, SearchHints, Values
from reality_gap.causes.support import typical_scales
from reality_gap.causes.support.model_overrides import ModelOffset
from reality_gap.causes.support.new_elements import add_actuator
from reality_gap.study.system import System
from reality_gap.types import Floats, Ints

SOLREF = (0.004, 1.0)
SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)
"""Solver parameters of ``frictionloss`` with little creep; MuJoCo's defaults let a tenth of the
force through at rest."""
NEARBY_CREEPS = (0.003, 0.03)
"""Velocities of creep from which fits start, over the typical velocity of an element."""
STABLE = 0.1
"""Largest stiffness of the bristles, as a multiple of moving mass over squared time step."""
DAMPED = 1.25
"""Ratio of the bristles' damping to stiffness in time steps; below it the force oscillates, because
MuJoCo applies it one step late."""
SLOW = 1e-3
"""Stribeck velocity [m/s or rad/s]; it has no effect, as static and sliding friction are equal."""
RELATIVE = 1.4
"""Travel in which presliding is measured, over the typical travel of tendons."""
SUMS = (int(mujoco.mjtSensor.mjSENS_TENDONACTFRC), int(mujoco.mjtSensor.mjSENS_JOINTACTFRC))
"""Sensors of the sum of all actuator forces on an element."""
SLIDING, RESTING = 3, 4
"""Entries of ``biasprm`` with sliding and static friction."""
STIFFNESS, DAMPING = 5, 6
"""Entries of ``dynprm`` with stiffness and damping of the bristles."""
SMALLEST = 1e-3
"""Smallest factor of the friction: MuJoCo needs a stiffness above 0."""
LOAD_PERIOD, SPEED_PERIOD = 0.006, 0.004
"""Time between changes of friction that depends on a load, or on the velocity [s]."""


def is_available(system: System) -> bool:
    """Return whether an actuator can represent friction in this study."""
    kinds = {int(system.model.sensor(name).type[0]) for name in system.sensed}
    return not system.study.inverse and kinds.isdisjoint(SUMS)


def presliding_parameter(system: System, location: Location) -> Parameter:
    """Return the parameter of the distance that an element moves before it slips [m or rad]."""
    if location.kind == "tendon":
        unit, travel = "m", RELATIVE * typical_scales.tendon_travel(system)
    else:
        unit, travel = typical_scales.joint_travel(system, location)
    size = 3e-4 * travel
    return Parameter(
        "presliding",
        unit,
        scale=size,
        tolerance=0.0,
        low=0.1 * size,
        high=30 * size,
        null=size,
        hints=SearchHints(shape=True),
    )


def presliding_parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    """Return the presliding parameter, or none where no actuator can represent friction."""
    return (presliding_parameter(system, location),) if is_available(system) else ()


def creep_parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    """Return the parameter of the velocity below which an element creeps [m/s or rad/s].

    It is 0 for an element that sticks, and has the bristles of the presliding distance. There is
    none where no actuator can represent friction.
    """
    if not is_available(system):
        return ()
    if location.kind == "tendon":
        unit, speed = "m/s", typical_scales.tendon_travel(system)
    else:
        unit = "m/s" if typical_scales.slides(system, location.elements[0]) else "rad/s"
        speed = typical_scales.joint_speed(system, location)
    sizes = (NEARBY_CREEPS[-1] * speed, 0.0, 0.0, speed)
    nearby = tuple(share * speed for share in NEARBY_CREEPS)
    return (Parameter("creep", unit, *sizes, hints=SearchHints(nearby=nearby, shape=True)),)


def has_nominal_friction(system: System, location: Location) -> bool:
    """Return whether the nominal model has dry friction in any of a location's tendons."""
    model = system.model
    tendons = [model.tendon(name).id for name in location.elements]
    motors = (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_DCMOTOR) & (
        model.actuator_biasprm[:, SLIDING] > 0.0
    )
    on_tendon = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
    braked = model.actuator_trnid[motors & on_tendon, 0]
    return bool(model.tendon_frictionloss[tendons].any() or np.isin(tendons, braked).any())


def add_friction(
    spec: mujoco.MjSpec,
    system: System,
    cause: str,
    location: Location,
    force: float,
    values: Values,
    constant: float = 0.0,
) -> None:
    """Add dry friction to all elements of a location.

    Args:
        spec: edited in place.
        system: the machine.
        cause: id of the cause; the names of the new actuators begin with it.
        location: tendons or joints.
        force: friction [N or N m]; a hook can change it during a replay, see `VariableFriction`.
        values: of the cause; without ``presliding``, the distance is the usual one [m or rad], and
            without ``creep`` the elements stick.
        constant: additional constant force [N or N m]; only where `is_available`.
    """
    on_tendon = location.kind == "tendon"
    if not is_available(system):
        for name in location.elements:
            element = spec.tendon(name) if on_tendon else spec.joint(name)
            element.frictionloss = element.frictionloss + force
            element.solref_friction, element.solimp_friction = SOLREF, SOLIMP
        return
    step = float(system.model.opt.timestep)
    if creep := values.get("creep", 0.0):
        for name in location.elements:
            element = spec.tendon(name) if on_tendon else spec.joint(name)
            _add_creeping(
                element, force, force / creep * _inverse_mass(system, location, name), step
            )
        return
    kind = mujoco.mjtTrn.mjTRN_TENDON if on_tendon else mujoco.mjtTrn.mjTRN_JOINT
    if "presliding" in values:  # a loaded posterior has no readings for the usual one
        distance = values["presliding"]
    else:
        distance = presliding_parameter(system, location).null
    for name in location.elements:
        limit = STABLE / (_inverse_mass(system, location, name) * step**2)
        stiffness = min(force / distance, limit)
        unique = _name(system, cause, location, name)
        while spec.actuator(unique) is not None:
            unique += "'"
        actuator = add_actuator(spec, name=unique, trntype=kind, target=name)
        actuator.set_to_dcmotor(
            motorconst=[0.0, 0.0],
            resistance=1.0,
            lugre=[stiffness, DAMPED * step * stiffness, force, force, SLOW],
            # Cogging without poles is a constant force.
            cogging=[constant, 0.0, np.pi / 2 if constant else 0.0],
            ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
        )


def _add_creeping(
    element: mujoco.MjsJoint | mujoco.MjsTendon, force: float, rate: float, step: float
) -> None:
    """Add friction that creeps to that of an element.

    At rest and within its limit, the force of MuJoCo's friction is ``-(a + b v) / R`` for an
    acceleration ``a`` and a velocity ``v``, with ``b = 2 / (d1 t)`` and ``R = (1 - d0) / (d0 m)``
    for a time constant ``t``, impedances ``d0`` and ``d1`` and the moving mass or inertia ``m``. In
    slow motion its slope over ``m`` is thus ``2 d0 / (d1 t (1 - d0))`` (MuJoCo's documentation,
    Computation, "Solver parameters").

    Args:
        element: a joint or a tendon.
        force: friction to add [N or N m].
        rate: slope of this force with the velocity, over the moving mass or inertia [1/s].
        step: time step; MuJoCo needs a time constant of two of them [s].
    """
    low, high = _in_range(*element.solimp_friction[:2])
    time, damping = (float(x) for x in element.solref_friction)
    if element.frictionloss > 0.0:
        rate += low / (1.0 - low) * (2.0 / time if time > 0.0 else -damping) / high
    element.frictionloss = element.frictionloss + force
    time = 2.0 * low / (high * (1.0 - low) * rate)
    if time < 2.0 * step:
        time = 2.0 * step
        one = 1.0 - 2.0 / (rate * time)
        low, high = _in_range(one, one)
    element.solref_friction = (time, 1.0)
    element.solimp_friction = (low, high, *element.solimp_friction[2:])


def _in_range(low: float, high: float) -> tuple[float, float]:
    """Return impedances as MuJoCo uses them: neither 0 nor 1, whatever a model says."""
    found = np.clip([low, high], mujoco.mjMINIMP, mujoco.mjMAXIMP)
    return float(found[0]), float(found[1])


def friction_actuators(system: System, cause: str, location: Location) -> dict[str, str]:
    """Return the names of the actuators of `add_friction`, by element.

    Args:
        system: the machine.
        cause: id of the cause, as in `add_friction`.
        location: tendons or joints, as in `add_friction`.
    """
    return {name: _name(system, cause, location, name) for name in location.elements}


class VariableFriction:
    """The friction that `add_friction` added to a location, for hooks that change it.

    Args:
        model: the compiled model with the friction.
        system: the machine.
        cause: id of the cause, as in `add_friction`.
        location: tendons or joints, as in `add_friction`.
    """

    def __init__(
        self, model: mujoco.MjModel, system: System, cause: str, location: Location
    ) -> None:
        self._bristles: list[tuple[ModelOffset, float | Floats]] = []
        self._deflections: Ints | None = None
        if is_available(system):
            names = [_name(system, cause, location, element) for element in location.elements]
            ids = np.array([model.actuator(name).id for name in names])
            self._deflections = model.actuator_actadr[ids]
            at = int(ids[0]) if len(ids) == 1 else ids
            self._levels = [
                ModelOffset(model.actuator_biasprm[:, k], at) for k in (SLIDING, RESTING)
            ]
            for k in (STIFFNESS, DAMPING):
                offset = ModelOffset(model.actuator_dynprm[:, k], at)
                nominal = model.actuator_dynprm[at, k]
                self._bristles.append((offset, float(nominal) if len(ids) == 1 else nominal))
        elif location.kind == "tendon":
            ids = np.array([model.tendon(name).id for name in location.elements])
            at = int(ids[0]) if len(ids) == 1 else ids
            self._levels = [ModelOffset(model.tendon_frictionloss, at)]
        else:
            ids = np.array([model.joint(name).dofadr[0] for name in location.elements])
            at = int(ids[0]) if len(ids) == 1 else ids
            self._levels = [ModelOffset(model.dof_frictionloss, at)]
        self._single = len(ids) == 1  # floats are faster than short arrays

    def directions(self, data: mujoco.MjData, velocity: Floats, creep: float) -> Floats:
        """Return the direction in which each element slides, or slid before it came to rest.

        At rest, the bristles of the LuGre model remain deflected in the direction of the last
        motion. With ``frictionloss``, only the velocity shows the direction.

        Args:
            data: the state.
            velocity: velocities of the elements, shape (k,).
            creep: velocity from which on the direction is clear.

        Returns:
            Directions from -1 to 1, shape (k,).
        """
        if self._deflections is not None:
            return np.sign(data.act[self._deflections])
        return np.tanh(velocity / creep)

    def scale(self, force: float, factor: float | Floats) -> None:
        """Set the friction to ``factor * force``.

        Args:
            force: the friction that was added to the model [N or N m].
            factor: one number or one for each element, shape (k,); at least `SMALLEST` is used,
                also for NaN, which a replay that diverges has.
        """
        if self._single:
            alone = factor if isinstance(factor, float) else float(np.asarray(factor).flat[0])
            factor = max(SMALLEST, alone)  # not NaN: no comparison with it is true
        else:
            factor = np.fmax(factor, SMALLEST)
        for level in self._levels:
            level.set(force * (factor - 1.0))
        for bristle, nominal in self._bristles:
            bristle.set(nominal * (factor - 1.0))


def _inverse_mass(system: System, location: Location, name: str) -> float:
    """Return one over the mass or inertia that moves with an element [1/kg or 1/(kg m^2)]."""
    model = system.model
    if location.kind == "tendon":
        return float(model.tendon_invweight0[model.tendon(name).id])
    return float(model.dof_invweight0[model.joint(name).dofadr[0]])


def _name(system: System, cause: str, location: Location, element: str) -> str:
    """Return a name that no actuator of the nominal model has, even if it is an extended model."""
    group = "all" if len(location.elements) > 1 else ""
    name = "/".join(filter(None, (cause, location.note, group, element)))
    while mujoco.mj_name2id(system.model, mujoco.mjtObj.mjOBJ_ACTUATOR, name) >= 0:
        name += "'"
    return name
