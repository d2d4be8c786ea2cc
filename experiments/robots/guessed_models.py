"""Guessed domain randomisation: each number of the nominal model by a factor of its own."""

from __future__ import annotations

import mujoco
import numpy as np

from kengoro_env.robot.fingers import FINGERS

GUESS = 0.2
"""Largest relative deviation of a guessed number."""


def guessed_models(nominal: mujoco.MjSpec, count: int, seed: int) -> list[mujoco.MjSpec]:
    """Models with masses, gains, least tensions, damping and armature within `GUESS`.

    Args:
        nominal: of `kengoro.study_model.study_model`; it is not edited.
        count: number of models.
        seed: of the guesses.
    """
    streams = np.random.default_rng(seed).spawn(count)
    return [_randomised(nominal.copy(), random) for random in streams]


def _randomised(spec: mujoco.MjSpec, random: np.random.Generator) -> mujoco.MjSpec:
    """Change each number of a nominal model by a factor of its own."""

    def factor() -> float:
        return float(random.uniform(1.0 - GUESS, 1.0 + GUESS))

    for body in spec.bodies:
        heavier = factor()
        for geom in body.geoms:
            geom.mass *= heavier  # without a mass, nan stays
        if body.explicitinertial:
            body.mass, body.inertia = body.mass * heavier, body.inertia * heavier
    for joint in spec.joints:
        joint.damping = joint.damping * factor()
        joint.armature *= factor()
    for tendon in spec.tendons:
        tendon.damping = tendon.damping * factor()
        if tendon.name == FINGERS:  # no muscle
            continue
        motor = spec.actuator(tendon.name)
        stiffer, least = factor(), factor()
        motor.gainprm[0] *= stiffer
        motor.biasprm[:2] *= (least, stiffer)
        motor.forcerange = motor.forcerange * (1.0, least)
    return spec
