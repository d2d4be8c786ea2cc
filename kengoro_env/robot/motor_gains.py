"""Gains of the motors of any robot, from its own model.

The largest tension T_max is that of the file's actuators where it has any: the smallest force limit
of those on muscles. A file without force limits gets a T_max from its load, in the proportion of
Kengoro's arm. The load is the tension to which the muscles can be held in most postures while they
hold gravity and springs and move the joints: the upper quartile over postures theta of

    min max_i T_i    with    G(theta)' T = g(theta) + s (M r / t^2 + d r / t + f),  T >= 0,

with the moment arms G, the torques g of gravity and springs, random signs s, the inertia M of each
joint, its range r, viscous and dry friction d and f, and t = 3 s for the whole range.

The other gains follow: T_bias from T_max, in the proportion of Kengoro's arm or halved until most
postures are reachable (`statics`), because a large T_bias may leave a posture without balance or
unstable; K_stiff from T_max and from how far the muscles move between the joint limits, and the
damping from K_stiff.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Literal, NamedTuple

import mujoco
import numpy as np

from kengoro_env.assets import assets_root
from kengoro_env.errors import ModelError
from kengoro_env.robot.model_file import is_asset, is_muscle, read_spec
from kengoro_env.robot.muscle_law import DEFAULT_GAINS, Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.statics import Statics, least_tensions
from kengoro_env.types import Floats
from mjcf_sandbox.mjcf import named_files

TRAVEL = 0.0211088
"""Travel of the muscles of Kengoro's arm [m]; its gains are `DEFAULT_GAINS`."""
LOAD = 73.0695
"""Load of the muscles of Kengoro's arm [N]."""
LOADS, MIDDLE, QUANTILE = 64, 0.6, 0.75
"""Number of postures of the load, the middle share of each joint's range that they are in, and the
quantile over them [1]."""
MISSED = 1e-6
"""Share of the largest torque that may be missing in a posture of the load [1]."""
BIASED, HALVINGS, MOST = 20, 6, 0.8
"""Number of postures by which T_bias is chosen, how often it is halved at most, and the share of
the postures that must be reachable with it [1]."""
DURATION = 3.0
"""Time in which a joint of the load moves through its whole range [s]."""
DIGITS = 3
"""Significant digits of the ratio of a robot to Kengoro's arm, so that rounding errors of another
computer do not change any gain."""

Source = Literal["actuators", "load"]


class DerivedGains(NamedTuple):
    """Gains of a robot, and what its largest tension comes from.

    Attributes:
        gains: of muscle stiffness control.
        source: "actuators" of the file, or "load", if the file has no force limits.
    """

    gains: Gains
    source: Source


def gains_of(scene: Path | str, folders: Sequence[Path | str] = ()) -> DerivedGains:
    """Gains of the robot in an MJCF file (module docstring); the default for our own files.

    Args:
        scene: MJCF file of the nominal model.
        folders: further folders whose files the model may include or load.

    Raises:
        ModelError: the file cannot be used.
    """
    if is_asset(scene):
        return DerivedGains(DEFAULT_GAINS, "load")
    path, allowed = Path(scene), tuple(Path(folder) for folder in folders)
    spec = read_spec(path, allowed)  # before the files are looked at again
    named = named_files(path, (path.parent, assets_root(), *allowed))
    states = tuple((file, file.stat().st_mtime_ns) for file in named if file.is_file())
    limits = actuator_limits(spec)
    return _derived(path, allowed, states, min(limits) if limits else None)


@lru_cache(maxsize=16)
def _derived(
    scene: Path,
    folders: tuple[Path, ...],
    states: tuple[tuple[Path, int], ...],
    limit: float | None,
) -> DerivedGains:
    """Gains of a robot whose files have not changed since; a limit of None is derived."""
    arm = NominalArm(scene, folders)
    source: Source = "load" if limit is None else "actuators"
    limit = DEFAULT_GAINS.limit * ratio(load(arm), LOAD) if limit is None else limit
    share = limit / DEFAULT_GAINS.limit
    stiffness = DEFAULT_GAINS.stiffness * share / ratio(arm.travel, TRAVEL)
    damping = DEFAULT_GAINS.damping * stiffness / DEFAULT_GAINS.stiffness
    gains = Gains(stiffness, DEFAULT_GAINS.bias * share, limit, damping)
    return DerivedGains(_with_bias(arm, gains), source)


def ratio(value: float, reference: float) -> float:
    """``value / reference``, to `DIGITS` significant digits."""
    return float(f"{value / reference:.{DIGITS}g}")


def _with_bias(arm: NominalArm, gains: Gains) -> Gains:
    """Gains with the largest T_bias, halved from theirs, at which most postures are reachable.

    If none is large enough, it is the one at which most are.
    """
    postures = list(_middle_postures(arm, np.random.default_rng(0)))[:BIASED]
    best, most = gains, -1
    for halved in range(HALVINGS + 1):
        candidate = replace(gains, bias=gains.bias / 2.0**halved)
        statics = Statics(arm, candidate)
        held = sum(statics.hold(posture).reachable for posture in postures)
        if held >= MOST * len(postures):
            return candidate
        if held > most:
            best, most = candidate, held
    return best


def load(arm: NominalArm) -> float:
    """Tension of muscles that hold and move the robot in most postures [N] (module docstring).

    Raises:
        ModelError: the muscles, which only pull, can hold the robot in no posture.
    """
    rng, ranges = np.random.default_rng(0), arm.upper - arm.lower
    damping, friction = arm.joint_friction()
    tensions: list[float] = []
    for posture in _middle_postures(arm, rng):
        moving = arm.inertia(posture) * ranges / DURATION**2 + damping * ranges / DURATION
        torque = arm.gravity(posture) + rng.choice([-1.0, 1.0], len(ranges)) * (moving + friction)
        pull, missing = least_tensions(arm.moment_arms(posture), torque, 0.0)
        if np.abs(missing).max() <= MISSED * np.abs(torque).max():
            tensions.append(float(pull.max()))
    if not tensions:
        raise ModelError(
            "the muscles, which only pull, hold the robot in no posture: each joint needs muscles "
            "on both sides, or gravity or a spring against them"
        )
    return float(np.quantile(tensions, QUANTILE))


def actuator_limits(spec: mujoco.MjSpec) -> list[float]:
    """Largest pull of each actuator on a muscle that has a limit [N].

    It is the force limit, else the largest control of a motor, else the peak force of a muscle.

    Args:
        spec: model with its actuators.
    """
    muscles = {tendon.name for tendon in spec.tendons if is_muscle(tendon)}
    model = spec.compile()
    limits = []
    for actuator in spec.actuators:
        if int(actuator.trntype) == int(mujoco.mjtTrn.mjTRN_TENDON) and actuator.target in muscles:
            limit = _pull(model, actuator.id)
            if 0.0 < limit < np.inf:
                limits.append(limit)
    return limits


def _pull(model: mujoco.MjModel, number: int) -> float:
    """Largest force of an actuator along its tendon [N]; infinite without a limit."""
    gear = abs(float(model.actuator_gear[number, 0]))
    gain, kind = model.actuator_gainprm[number], int(model.actuator_gaintype[number])
    if model.actuator_forcelimited[number]:
        return gear * float(np.abs(model.actuator_forcerange[number]).max())
    if kind == int(mujoco.mjtGain.mjGAIN_MUSCLE):
        peak = float(gain[2])
        return gear * (peak if peak > 0.0 else float(gain[3] / model.actuator_acc0[number]))
    direct = int(model.actuator_biastype[number]) == int(mujoco.mjtBias.mjBIAS_NONE)
    if direct and model.actuator_ctrllimited[number]:
        return gear * float(abs(gain[0]) * np.abs(model.actuator_ctrlrange[number]).max())
    return np.inf


def _middle_postures(arm: NominalArm, rng: np.random.Generator) -> Iterator[Floats]:
    """`LOADS` postures (n,) [rad], uniform in the middle of the joint ranges."""
    middle, ranges = 0.5 * (arm.lower + arm.upper), arm.upper - arm.lower
    for share in rng.uniform(-0.5, 0.5, (LOADS, len(ranges))):
        yield middle + MIDDLE * share * ranges
