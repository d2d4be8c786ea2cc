"""Gravity compensation: the firmware adds a share of the gravity load to the forces of motors.

The load of a joint is that of all bodies beyond it at the actual posture. It is part of the motor's
force, which limits and effort sensors see. A negative share takes away a compensation that the
nominal model has (``gravcomp``).
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Values
from reality_gap.causes.support import joint_motors
from reality_gap.causes.support.actuators import make_affine
from reality_gap.causes.support.model_overrides import ModelOffset
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    if not np.any(system.model.opt.gravity):
        return ()
    return joint_motors.each_and_all(system, joint_motors.is_motor)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    low = -1.1 if np.any(system.model.body_gravcomp) else 0.0
    return (Parameter("share", "1", 0.2, 0.002, low, 1.5),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if values["share"]:
        for name in location.elements:
            make_affine(spec.actuator(name))


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    if values["share"]:
        joints = {name: joint_motors.joint_of(system, name) for name in location.elements}
        effects.add_hook(lambda model: _Compensation(model, joints, values["share"]))


class _Compensation:
    """Hook that adds gravity loads to the biases of motors, from the previous step's posture."""

    def __init__(self, model: mujoco.MjModel, joints: dict[str, str], share: float) -> None:
        ids = np.array([model.actuator(name).id for name in joints])
        self._joints = np.array([model.joint(name).id for name in joints.values()])
        self._bodies = model.jnt_bodyid[self._joints]
        hinge = model.jnt_type[self._joints] == int(mujoco.mjtJoint.mjJNT_HINGE)
        masses = model.body_subtreemass[self._bodies]
        weight = masses[:, None] * model.opt.gravity
        # Moments are products with constant matrices: np.cross would take most of a replay's time.
        self._turns = np.where(hinge[:, None, None], np.cross(np.eye(3), weight[:, None]), 0.0)
        self._push = np.where(hinge[:, None], 0.0, weight)
        self._factor = -share / model.actuator_gear[ids, 0]
        self._bias = ModelOffset(model.actuator_biasprm[:, 0], ids)
        self._fresh = False

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write the biases."""
        if not self._fresh:
            mujoco.mj_fwdPosition(model, data)
            self._fresh = True
        lever = data.subtree_com[self._bodies] - data.xanchor[self._joints]
        moment = np.matmul(lever[:, None], self._turns)[:, 0] + self._push
        load = np.einsum("ji,ji->j", data.xaxis[self._joints], moment)
        self._bias.set(self._factor * load)


CAUSE = Cause(
    id="gravity_compensation",
    title="gravity compensation",
    explanation="The motors add a share of the load by gravity to their commanded force.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
