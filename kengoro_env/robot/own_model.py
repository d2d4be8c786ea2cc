"""Model of a user for the robot, such as an extended model or a sample of a diagnosis.

It has the joints and muscles of the scene, an actuator on the tendon of each muscle, and what the
task names beside them, such as a can. With the tendon's length L, the command c and the gains of
the actuator it pulls by

    T = -(gain c + bias_0 + bias_1 L), within its range of forces,

which is muscle stiffness control with K_stiff = -bias_1 and T_bias and T_max from the range. What
bias_0 differs from -T_bias by is an offset of the encoder, (-bias_0 - T_bias) / K_stiff.

Commands and readings count from the scene's nominal lengths in the zero posture, as in the log from
which the model was identified.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import mujoco
import numpy as np
from gymnasium import logger

from kengoro_env.errors import ArgumentError, ModelError
from kengoro_env.robot.draft import Draft
from kengoro_env.robot.model_file import load_spec, read_spec
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.tendons import actuated_joints
from kengoro_env.types import Floats


class HasSpec(Protocol):
    """An object with a model, such as an extended model of `reality_gap`."""

    @property
    def spec(self) -> mujoco.MjSpec:
        """The model; it is not edited."""


Model: TypeAlias = mujoco.MjSpec | HasSpec | Path | str
"""A spec, an object that has one, or the path of an MJCF file."""

LONGEST_STEP = 0.005
"""Longest time step of a model [s]."""


@dataclass(frozen=True)
class Nominal:
    """What a model must have in common with its scene.

    Attributes:
        muscles, joints: their names, in order.
        zero: lengths of the tendons in the zero posture (m,) [m].
    """

    muscles: tuple[str, ...]
    joints: tuple[str, ...]
    zero: Floats


@cache
def _nominal(scene: Path) -> Nominal:
    draft = Draft.of(load_spec(scene))
    model, muscles = draft.spec.compile(), tuple(draft.tendons)
    return Nominal(muscles, actuated_joints(model), _zero(model, muscles))


def _zero(model: mujoco.MjModel, muscles: tuple[str, ...]) -> Floats:
    return np.array([model.tendon_length0[model.tendon(muscle).id] for muscle in muscles])


@dataclass(frozen=True)
class SharedModel:
    """A model that copies share, for a `mujoco.MjSpec` cannot be copied by `copy.deepcopy`.

    Attributes:
        model: the model.
    """

    model: object

    @property
    def spec(self) -> mujoco.MjSpec:
        """See `HasSpec`."""
        spec: mujoco.MjSpec = getattr(self.model, "spec", self.model)
        return spec

    @property
    def effects(self) -> object:
        """Effects of an extended model beside its MJCF."""
        return getattr(self.model, "effects", None)

    def __deepcopy__(self, memo: dict[int, object]) -> SharedModel:
        """Itself: the model is never edited."""
        return self


class OwnModel:
    """Departure: a model of a user in place of the scene.

    Args:
        model: the model.
        scene: MJCF file of the scene that it replaces.
        name: of the model in messages.
        elements: what the model must have beside joints and muscles, each a kind and a name.

    Raises:
        ArgumentError: this is no model, or it does not fit the scene.
        ModelError: it does not compile, or its file cannot be read.
    """

    def __init__(
        self,
        model: Model,
        scene: Path,
        name: str = "model",
        elements: Sequence[tuple[str, str]] = (),
    ) -> None:
        self._spec, self._nominal = _spec_of(model, name), _nominal(scene)
        try:
            self._model = self._spec.compile()
        except ValueError as error:
            reason = " ".join(str(error).split())
            raise ModelError(f"{name} does not compile: {reason}") from error
        self._check(name)
        self._check_elements(name, elements)

    def _check_elements(self, name: str, elements: Sequence[tuple[str, str]]) -> None:
        """Refuse a model without an element, or with another kind of joint than the scene's."""
        model = self._model
        for kind, element in elements:
            if element not in _names(model, kind):
                raise ArgumentError(f"{name} has no {kind} {element!r}, which the task needs")
            if kind == "joint" and model.joint(element).type[0] != mujoco.mjtJoint.mjJNT_FREE:
                raise ArgumentError(f"the joint {element!r} of {name} must be free")

    def _check(self, name: str) -> None:
        model, nominal = self._model, self._nominal
        for kind, elements in (("tendon", nominal.muscles), ("actuator", nominal.muscles)):
            known = _names(model, kind)
            missing = [each for each in elements if each not in known]
            if missing:
                raise ArgumentError(
                    f"{name} has no {kind} {missing[0]!r}: it needs one for each of the "
                    f"{len(elements)} muscles of the scene"
                )
        self._check_option(name)
        joints = actuated_joints(model)
        if joints != nominal.joints:
            raise ArgumentError(
                f"{name} must have the joints of the scene, {', '.join(nominal.joints)}; its "
                f"tendons cross {', '.join(joints) or 'none'}"
            )
        for joint in joints:
            if model.joint(joint).type[0] != mujoco.mjtJoint.mjJNT_HINGE:
                raise ArgumentError(
                    f"the joint {joint!r} of {name} must be a hinge, as in the scene"
                )
            if not model.joint(joint).range[0] < model.joint(joint).range[1]:
                raise ArgumentError(
                    f"the joint {joint!r} of {name} must have a range, as in the scene: targets "
                    "are sampled within it"
                )
        for muscle in nominal.muscles:
            self._check_actuator(muscle, f"the actuator {muscle!r} of {name}")
            if model.actuator_ctrladr[model.actuator(muscle).id] != model.actuator(muscle).id:
                raise ArgumentError(f"the muscles must be the first actuators of {name}")

    def _check_actuator(self, muscle: str, named: str) -> None:
        """Refuse an actuator that is no muscle stiffness control of its tendon."""
        actuator = self._model.actuator(muscle)
        gain, bias, (low, high) = actuator.gainprm[0], actuator.biasprm, actuator.forcerange
        if not np.isfinite([gain, *bias, low, high]).all():
            raise ArgumentError(f"the gain, bias and forcerange of {named} must be finite")
        on = int(actuator.trntype[0]) == int(mujoco.mjtTrn.mjTRN_TENDON)
        if not on or not np.isclose(gain, -bias[1], rtol=1e-4) or gain <= 0.0 or bias[2]:
            raise ArgumentError(
                f"{named} must pull its tendon by muscle stiffness control: a gain above 0, "
                "biasprm (b, -gain, 0) and a range of forces"
            )
        if actuator.gear[0] != 1.0:
            raise ArgumentError(f"{named} must have the gear 1, it has {actuator.gear[0]:g}")
        if actuator.ctrllimited[0]:
            raise ArgumentError(
                f"{named} must have no ctrlrange: its commands are lengths of its tendon"
            )
        if not actuator.forcelimited[0]:
            raise ArgumentError(f"{named} has no forcerange")
        if not low < high <= 0.0:
            raise ArgumentError(
                f"the forcerange of {named} must be of tensions, from -T_max to -T_bias, it is "
                f"from {low:g} to {high:g} N"
            )

    def _check_option(self, name: str) -> None:
        """Refuse a model whose physics steps are too long, or whose muscles cannot pull."""
        option = self._model.opt
        if not 0.0 < option.timestep <= LONGEST_STEP:
            raise ArgumentError(
                f"the timestep of {name} is {option.timestep:g} s, but must be above 0 and at most "
                f"{LONGEST_STEP:g} s"
            )
        if option.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION:
            raise ArgumentError(f"the actuation of {name} is disabled by a flag of its option")

    def edit(self, draft: Draft) -> None:
        """Replace the model, and note gains and encoder offsets of its muscles."""
        model, nominal = self._model, self._nominal
        ids = np.array([model.actuator(muscle).id for muscle in nominal.muscles])
        tendons = np.array([model.tendon(muscle).id for muscle in nominal.muscles])
        least, most = -model.actuator_forcerange[ids].T[::-1]
        stiffness, rest = model.actuator_gainprm[ids, 0], -model.actuator_biasprm[ids, 0]
        damping = model.tendon_damping[tendons].reshape(len(ids), -1)[:, 0]
        values: Any = (stiffness.copy(), least.copy(), most.copy(), damping.copy())
        draft.own_gains = Gains(*values)
        offset = (rest - least) / stiffness + _zero(model, nominal.muscles) - nominal.zero
        draft.sensor_errors.length_offset = dict(zip(nominal.muscles, offset.tolist(), strict=True))
        draft.spec = self._spec.copy()


def _names(model: mujoco.MjModel, kind: str) -> set[str]:
    """Names of a model's elements of a kind."""
    short = {"joint": "jnt", "camera": "cam"}.get(kind, kind)
    return {getattr(model, kind)(i).name for i in range(getattr(model, f"n{short}"))}


def _spec_of(model: object, name: str) -> mujoco.MjSpec:
    """A copy of the model's spec."""
    if isinstance(model, str | Path):
        return read_spec(model)
    _warn_of_effects(model, name)
    spec = getattr(model, "spec", model)
    if not isinstance(spec, mujoco.MjSpec):
        raise ArgumentError(
            f"{name} must be a mujoco.MjSpec, have one as `spec`, or be the path of an MJCF file, "
            f"got {type(model).__name__}"
        )
    return spec.copy()


def _warn_of_effects(model: object, name: str) -> None:
    """Say which effects of an extended model MuJoCo cannot express, and are left out here."""
    left_out = [
        f"{effect.cause.id} of {', '.join(effect.location.elements) or 'the model'}"
        for effect in getattr(model, "effects", None) or ()
    ]
    if left_out:
        logger.warn(
            f"the {name.partition('[')[0]} given to the environment has effects beside its MJCF, "
            f"which are not simulated: {'; '.join(left_out)}"
        )
