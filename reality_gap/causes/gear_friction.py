"""Gear friction of a joint: dry friction that grows with the torque that its gear transmits.

The teeth of a gear under the torque ``T`` of the motor rub with the friction ``coefficient |T|``,
in addition to what does not depend on the load. A gear of the efficiency ``e`` has a coefficient of
about ``1 - e`` while it drives. Source: the load-dependent model of M. Duclusaud et al., "Extended
Friction Models for the Physics Simulation of Servo Actuators", ICRA 2025; for harmonic drives, P.
Hamon, M. Gautier and P. Garrec, "Dynamic identification of robots with a dry friction model
depending on load and velocity", IROS 2010.

The torque is that of the joint's motor, or, where efforts are compared by inverse dynamics, the
computed one.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import efforts, elements, joint_motors, lugre, typical_scales
from reality_gap.study.system import System

SECANTS = (0.3,)
"""Coefficients at which the cause is screened in addition to a small one."""
MOST = 0.9
"""Largest coefficient; a gear with a larger one does not move."""
ODDS = -1.0
"""Log odds of friction that grows with the load [nats]: constant friction does nearly the same."""


def _locations(system: System) -> tuple[Location, ...]:
    if system.study.inverse:
        found = efforts.joints(system)
    else:
        found = tuple(name for name in system.joints if joint_motors.motors_of(system, name))
    every = (Location("joint", found),) if len(found) > 1 else ()
    return tuple(Location("joint", (name,)) for name in found) + every


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    hints = SearchHints(secants=elements.secants(system, location, SECANTS))
    coefficient = Parameter("coefficient", "1", 0.05, 0.002, 0.0, MOST, hints=hints)
    return (coefficient, *lugre.presliding_parameters(system, location))


def _usual(system: System, location: Location, coefficient: float) -> float:
    """Return the friction at the typical torque [N or N m]."""
    return coefficient * typical_scales.weakest_force(system, location)[1]


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if values["coefficient"]:
        usual = _usual(system, location, values["coefficient"])
        lugre.add_friction(spec, system, CAUSE.id, location, usual, values)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    mu = values["coefficient"]
    if not mu:
        return
    usual = _usual(system, location, mu)
    motors = [joint_motors.motors_of(system, name) for name in location.elements]

    def make(model: mujoco.MjModel) -> Hook:
        friction = lugre.VariableFriction(model, system, CAUSE.id, location)
        dofs = np.array([model.joint(name).dofadr[0] for name in location.elements])
        drives = [
            [joint_motors.MotorForce(model, name, joint) for name in names]
            for names, joint in zip(motors, location.elements, strict=True)
        ]

        def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            torque = [abs(sum(drive(model, data) for drive in own)) for own in drives]
            share = mu / usual
            friction.scale(
                usual, share * torque[0] if len(torque) == 1 else share * np.array(torque)
            )

        def inverse(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            friction.scale(usual, 0.0)
            mujoco.mj_inverse(model, data)
            load, speed = data.qfrc_inverse[dofs], data.qvel[dofs]
            torque = np.abs(load) / (1.0 - mu * np.sign(load * speed))
            friction.scale(usual, mu * torque / usual)

        return inverse if system.study.inverse else hook

    effects.add_hook(make, period=lugre.LOAD_PERIOD)


def _prior(location: Location) -> float:
    return ODDS


CAUSE = Cause(
    id="gear_friction",
    title="gear friction that grows with the load",
    explanation="A gear rubs in proportion to the torque that it transmits.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    fine=True,
    sticky=True,
    prior=_prior,
)
