"""Elastic gear: the rotor of a motor, which moves a joint through a spring.

The rotor with the inertia ``J`` at the position ``m``, and the joint at ``q``, obey

    J m'' = F(u, m, m') - T        T = (m - q) / c        I q'' = T + I a

with the force ``F`` of the motor within its limits, the compliance ``c``, the inertia ``I`` that
the rest of the machine shows at the joint, and the acceleration ``a`` by all other forces. Source:
M. W. Spong, "Modeling and Control of Elastic Joint Robots", J. Dyn. Sys., Meas., Control 109
(1987).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.causes.support.actuators import Drive
from reality_gap.types import Floats

IMPLICIT = (
    int(mujoco.mjtIntegrator.mjINT_IMPLICIT),
    int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST),
)
"""Integrators that compute the damping of servos from the velocity after the step."""
RESOLVED = 0.5
"""Largest step over the time constant of a damped rotor at which others are stable."""
LEAST = 1e-3
"""Least share of a rotor's inertia that stays at the joint, for links that have no other."""


@dataclass
class _Rotor:
    """State of a rotor; velocity of its link before and, as expected, after the previous step."""

    position: float
    velocity: float
    link_velocity: float
    expected: float
    bias: float
    damping: float


@dataclass(frozen=True)
class _Link:
    """State of a link, its acceleration per torque of the spring, and that by all else."""

    position: float
    velocity: float
    mobility: float
    acceleration: float


@dataclass(frozen=True)
class _Law:
    """Force of a motor, ``force - stiffness m - damping m'``."""

    force: float
    stiffness: float = 0.0
    damping: float = 0.0


class ElasticGear:
    """Hook that lets an actuator exert the torque of a spring between its rotor and its joint.

    Rotor and link are solved at once in each step, so that gears of any stiffness are stable, with
    the joint's damping, and ``a`` of the previous step without friction and contacts. The spring
    has Newmark's weights of three positions: (1, 2, 1) / 4 where the steps resolve the vibration of
    the gear, and (1, 0, 0) where they do not, so that it gives way without vibrating. There, rotor
    and damping also stay at the joint, and the actuator exerts in addition what accelerates them,
    so that a stiff gear is a rigid one. Several gears of one arm may diverge where each rotor is a
    thousand times as heavy as its link.

    Args:
        model: of the replay; the rotor's inertia is that of the joint.
        motor: name of the actuator.
        joint: name of the joint that it moves.
        compliance: of the gear [rad/(N m) or m/N].
        softer: factor by which the gains were divided in the model.
    """

    def __init__(
        self, model: mujoco.MjModel, motor: str, joint: str, compliance: float, softer: float
    ) -> None:
        self._index = i = int(model.actuator(motor).id)
        self._position = int(model.joint(joint).qposadr[0])
        self._dof = int(model.joint(joint).dofadr[0])
        self._drive, self._compliance, self._softer = Drive(model, i), compliance, softer
        self._step, self._gear = float(model.opt.timestep), float(model.actuator_gear[i, 0])
        self._joint = int(model.joint(joint).id)
        self._low, self._high = self._limits(model)
        self._right, self._found = np.zeros((2, 2, model.nv))
        self._right[0, self._dof] = 1.0
        self._bias = self._written = float(model.actuator_biasprm[i, 0])
        self._rotor: _Rotor | None = None
        self._history: list[tuple[float, float]] = []

    def _limits(self, model: mujoco.MjModel) -> tuple[float, float]:
        """Return the smaller of the limits of the actuator and of its joint."""
        i, joint, low, high = self._index, self._joint, -math.inf, math.inf
        if model.actuator_forcelimited[i]:
            low, high = sorted((self._gear * model.actuator_forcerange[i]).tolist())
        if model.jnt_actfrclimited[joint]:
            own = model.jnt_actfrcrange[joint].tolist()
            low, high = max(low, own[0]), min(high, own[1])
        return low, high

    def exerted(self, count: int) -> tuple[Floats, Floats]:
        """Return the torques of motor and spring in the last steps, (count,) each [N m or N]."""
        motor, spring = np.array(self._history[-count:], dtype=np.float64).T
        return motor, spring

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write the bias with which the link moves as by the spring."""
        if self._rotor is None:
            self._take_over(model, data)
        i, gear, bias = self._index, self._gear, model.actuator_biasprm
        self._bias += float(bias[i, 0]) - self._written
        force = gear * self._softer * (self._gain * self._drive(model, data) + self._bias)
        law = _Law(force, self._stiffness, self._damping)
        if self._rotor is None:
            self._rotor = self._at_rest(law, data)
        link = self._link(model, data, self._rotor)
        self._advance(self._rotor, law, link)
        self._written = self._rotor.bias / gear
        bias[i, 0], bias[i, 2] = self._written, -self._rotor.damping / gear**2

    def _take_over(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Take rotor, feedback and limits out of the model."""
        i, gear, step = self._index, self._gear, self._step
        affine = int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        bias = [float(x) if affine else 0.0 for x in model.actuator_biasprm[i, :3]]
        self._gain, self._bias = float(model.actuator_gainprm[i, 0]), bias[0]
        self._stiffness, self._damping = (-self._softer * gear**2 * x for x in bias[1:])
        self._damping += gear**2 * float(model.actuator_damping[i].flat[0])
        self._inertia = self._softer**2 * float(model.dof_armature[self._dof])
        self._inertia += gear**2 * float(model.actuator_armature[i])
        model.actuator_biastype[i] = int(mujoco.mjtBias.mjBIAS_AFFINE)
        model.actuator_gainprm[i, 0] = model.actuator_biasprm[i, 1] = 0.0
        model.actuator_biasprm[i, 0] = self._written = self._bias
        model.actuator_forcelimited[i] = model.jnt_actfrclimited[self._joint] = 0
        model.actuator_damping[i] = model.actuator_armature[i] = 0.0
        self._leave(LEAST * self._inertia, model, data)
        rigid = self._rigidity(self._damping, self._mobility(model, data))
        is_implicit = int(model.opt.integrator) in IMPLICIT
        self._carried = max(LEAST, rigid)
        self._stays = self._carried * self._inertia
        self._keeps = rigid if is_implicit else 0.0
        explicit = not is_implicit and step * self._damping < RESOLVED * self._inertia
        self._ahead = 0.0 if explicit else 1.0
        self._leave(self._stays, model, data)

    def _leave(self, inertia: float, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Leave an inertia of the rotor at the joint."""
        model.dof_M0[self._dof] += inertia - model.dof_armature[self._dof]
        model.dof_armature[self._dof] = inertia
        mujoco.mj_fwdPosition(model, data)

    def _mobility(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the acceleration of the joint per torque."""
        self._right[1] = 0.0
        mujoco.mj_solveM(model, data, self._found, self._right)
        return float(self._found[0, self._dof])

    def _rigidity(self, damping: float, mobility: float) -> float:
        """Return 0 where the steps resolve the fastest vibration of the gear, 1 where not."""
        step, spring = self._step, 1.0 / self._compliance
        heavy = self._inertia + 0.5 * step * damping
        if not heavy:
            return 1.0
        fast = step**2 * (mobility * spring + (spring + self._stiffness) / heavy)
        return fast / (1.0 + fast)

    def _at_rest(self, law: _Law, data: mujoco.MjData) -> _Rotor:
        """Return the rotor that turns with the link."""
        position, velocity = float(data.qpos[self._position]), float(data.qvel[self._dof])
        force = law.force - law.stiffness * position - law.damping * velocity
        torque = force / (1.0 + law.stiffness * self._compliance)
        torque = min(max(torque, self._low), self._high)
        start = position + self._compliance * torque
        return _Rotor(start, velocity, velocity, velocity, torque, 0.0)

    def _link(self, model: mujoco.MjModel, data: mujoco.MjData, rotor: _Rotor) -> _Link:
        """Return the link without the share of the rotor that stays at it."""
        step, dof, velocity = self._step, self._dof, float(data.qvel[self._dof])
        self._right[1] = data.qfrc_constraint
        mujoco.mj_solveM(model, data, self._found, self._right)
        mobility, stopped = self._found[:, dof].tolist()
        damping = float(model.dof_damping[dof].flat[0])
        exerted = rotor.bias - (rotor.damping + damping) * velocity
        carried = self._carried * (velocity - rotor.expected)
        rotor.velocity += carried
        rotor.position += step * carried
        rest = (velocity - rotor.link_velocity) / step - mobility * exerted - stopped
        alone = max(LEAST, 1.0 - self._stays * mobility)
        damped = 1.0 / (1.0 + step * damping * mobility / alone)
        free = (damped * (velocity + step * rest / alone) - velocity) / step
        return _Link(float(data.qpos[self._position]), velocity, damped * mobility / alone, free)

    def _advance(self, rotor: _Rotor, law: _Law, link: _Link) -> None:
        force = law.force - law.stiffness * rotor.position - law.damping * rotor.velocity
        following, torque, mean = self._solved(rotor, law, link)
        if not self._low <= mean <= self._high:
            law = _Law(min(max(mean, self._low), self._high))
            following, torque, _ = self._solved(rotor, law, link)
        self._history.append((min(max(force, self._low), self._high), torque))
        acceleration = link.acceleration + link.mobility * torque
        rotor.expected = link.velocity + self._step * acceleration
        rotor.damping = self._keeps * law.damping
        rotor.bias = torque + self._stays * acceleration + rotor.damping * rotor.expected
        rotor.position += self._step * following
        rotor.velocity, rotor.link_velocity = following, link.velocity

    def _solved(self, rotor: _Rotor, law: _Law, link: _Link) -> tuple[float, float, float]:
        """Return the rotor's next velocity, the torque of the spring and the motor's force."""
        step, inertia, compliance = self._step, self._inertia, self._compliance
        rigid, share = self._rigidity(law.damping, link.mobility), self._share(law)
        ahead = 0.25 * (1.0 + rigid) ** 2
        lead = rotor.position - link.position
        known = lead - step * ahead * (link.velocity + step * link.acceleration)
        known -= step * (ahead - rigid) * (rotor.velocity - link.velocity)
        give = compliance + ahead * step**2 * link.mobility
        held = law.force - law.stiffness * (rotor.position - share * lead)
        held -= law.damping * (1.0 - self._ahead) * rotor.velocity
        load, back = self._ahead * law.damping, law.stiffness * share * compliance
        heavy = inertia + step * load + (1.0 + back) * step**2 * ahead / give
        push = step * (held - (1.0 + back) * known / give)
        following = (inertia * rotor.velocity + push) / heavy
        torque = (known + ahead * step * following) / give
        return following, torque, held - load * following - back * torque

    def _share(self, law: _Law) -> float:
        """Return 1 where the rotor's position is that behind the spring at once, 0 where slowly."""
        fast = self._step**2 * law.stiffness
        heavy = self._inertia + self._step * law.damping
        return fast / (fast + heavy) if law.stiffness else 0.0
