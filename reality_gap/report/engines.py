"""Input for other engines: an extended model for MJX and for MuJoCo Warp.

Both read what MuJoCo reads, but not every element. MJX (JAX) has no actuator with a friction state,
by which an extended model has dry friction; it becomes friction loss of the same joint or tendon,
which does not move before it slips. What has no such replacement is named.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import mujoco

from reality_gap.causes.support.lugre import SLIDING
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.extended import Extended

Engine = Literal["mjx", "warp"]

MOTOR = 1
"""Index of the motor constant in `gainprm`; 0 for an actuator that is friction alone."""

_COMMON: dict[str, frozenset[str]] = {
    "trn": frozenset({"JOINT", "JOINTINPARENT", "SITE", "TENDON"}),
    "dyn": frozenset({"NONE", "INTEGRATOR", "FILTER", "FILTEREXACT", "MUSCLE"}),
    "gain": frozenset({"FIXED", "AFFINE", "MUSCLE"}),
    "bias": frozenset({"NONE", "AFFINE", "MUSCLE"}),
    "integrator": frozenset({"EULER", "RK4", "IMPLICITFAST", "DISCRETE"}),
    "solver": frozenset({"CG", "NEWTON"}),
    "eq": frozenset({"CONNECT", "WELD", "JOINT", "TENDON"}),
}
"""What both engines support, of MJX 3.17 and MuJoCo Warp 4.0."""

_MORE: dict[str, dict[str, frozenset[str]]] = {
    "mjx": {},
    "warp": {
        "trn": frozenset({"SLIDERCRANK", "BODY"}),
        "dyn": frozenset({"DCMOTOR", "USER"}),
        "gain": frozenset({"DCMOTOR", "USER", "SO3"}),
        "bias": frozenset({"DCMOTOR", "USER"}),
        "integrator": frozenset({"IMPLICIT"}),
        "eq": frozenset({"FLEX", "FLEXSTRAIN"}),
    },
}
"""What each supports in addition."""


@dataclass(frozen=True)
class EngineInput:
    """A model for another engine.

    Attributes:
        spec: the model; ``spec.compile()`` is what `mjx.put_model` or `mujoco_warp.put_model` take.
        replaced: sentences on elements that were replaced.
        lacking: sentences on elements that the engine lacks; it can run the model if there are
            none.
    """

    spec: mujoco.MjSpec
    replaced: tuple[str, ...]
    lacking: tuple[str, ...]


def engine_input(model: mujoco.MjSpec | Extended, engine: Engine) -> EngineInput:
    """Return a model for another engine, such as ``load_extended(folder)``.

    Args:
        model: the model; it is not edited. Effects that an extended one has beside its spec are
            lacking in each engine.
        engine: "mjx" or "warp".

    Raises:
        UnknownNameError: the engine is unknown.
        StudyError: ``model`` is something else.
    """
    if engine not in _MORE:
        raise UnknownNameError("engine", engine, _MORE)
    given, beside = spec_of(model)
    spec = given.copy()
    replaced = tuple(_replace_friction(spec)) if engine == "mjx" else ()
    return EngineInput(spec, replaced, (*beside, *_lacking(spec.compile(), engine)))


def spec_of(model: object) -> tuple[mujoco.MjSpec, tuple[str, ...]]:
    """Return the spec of a model, and a sentence on each effect that is not in it.

    Raises:
        StudyError: it is neither a spec nor an extended model.
    """
    if isinstance(model, Extended):
        effects = tuple(
            f"{effect.cause.id} at {', '.join(effect.location.elements)} is not in the model, but "
            "beside it"
            for effect in model.effects
        )
        return model.spec, effects
    if isinstance(model, mujoco.MjSpec):
        return model, ()
    raise StudyError(
        "the model must be an extended one, such as load_extended(folder), or a mujoco.MjSpec, "
        f"not of the type {type(model).__name__}"
    )


def actuator_name(model: mujoco.MjModel, i: int) -> str:
    """Return the name of an actuator; its number if it has none."""
    return str(model.actuator(i).name) or f"number {i}"


def unit_of(element: mujoco.MjsJoint | mujoco.MjsTendon) -> str:
    """Return the unit of a force on a joint or tendon."""
    hinge = isinstance(element, mujoco.MjsJoint) and element.type == mujoco.mjtJoint.mjJNT_HINGE
    return "N m" if hinge else "N"


def _replace_friction(spec: mujoco.MjSpec) -> Iterator[str]:
    """Replace actuators that are dry friction by friction loss; yield a sentence on each."""
    for actuator in list(spec.actuators):
        element = friction_of(spec, actuator)
        if element is None:
            continue
        force = float(actuator.biasprm[SLIDING]) * abs(float(actuator.gear[0]))
        element.frictionloss += force
        constant = " and its constant force" if actuator.biasprm[0] else ""
        yield (
            f"the dry friction {actuator.name} is friction loss of {element.name}, {force:.4g} "
            f"{unit_of(element)}, without motion before it slips{constant}"
        )
        spec.delete(actuator)


def friction_of(spec: mujoco.MjSpec, actuator: mujoco.MjsActuator) -> Any:
    """Return the joint or tendon on which an actuator is dry friction alone; None if it is not."""
    if actuator.dyntype != mujoco.mjtDyn.mjDYN_DCMOTOR or actuator.biasprm[SLIDING] <= 0.0:
        return None
    if actuator.gainprm[MOTOR]:  # a motor with friction
        return None
    if actuator.trntype == mujoco.mjtTrn.mjTRN_TENDON:
        return spec.tendon(actuator.target)
    return spec.joint(actuator.target) if actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT else None


def _lacking(model: mujoco.MjModel, engine: str) -> Iterator[str]:
    """Yield a sentence on each element that an engine lacks."""
    name = {"mjx": "MJX", "warp": "MuJoCo Warp"}[engine]
    known = {kind: _COMMON[kind] | _MORE[engine].get(kind, frozenset()) for kind in _COMMON}
    for i in range(model.nactuator):
        for kind in ("trn", "dyn", "gain", "bias"):
            value = _word(kind, getattr(model, f"actuator_{kind}type")[i])
            if value not in known[kind]:
                own = actuator_name(model, i)
                yield f"the actuator {own} is {kind}type {value}, not in {name}"
    for i in range(model.neq):
        value = _word("eq", model.eq_type[i])
        if value not in known["eq"]:
            yield f"the equality constraint {model.equality(i).name} is {value}, not in {name}"
    for kind in ("integrator", "solver"):
        value = _word(kind, getattr(model.opt, kind))
        if value not in known[kind]:
            yield f"the {kind} is {value}, not in {name}"
    if engine == "mjx" and model.nflex:
        yield f"the model has flexible bodies, not in {name}"
    if model.nplugin:
        yield f"the model has plugins, not in {name}"


_ENUMS = {
    "trn": mujoco.mjtTrn,
    "dyn": mujoco.mjtDyn,
    "gain": mujoco.mjtGain,
    "bias": mujoco.mjtBias,
    "eq": mujoco.mjtEq,
    "integrator": mujoco.mjtIntegrator,
    "solver": mujoco.mjtSolver,
}


def _word(kind: str, value: Any) -> str:
    """Return the last part of the name of a constant, as TENDON of mjTRN_TENDON."""
    return str(_ENUMS[kind](int(value)).name).partition("_")[2]
