"""Springs and rotors of joints, and joints with less than the model says.

Amplitudes: joint_stiffness [N m/rad or N/m], about the rest position ``rest``; armature
[kg m^2 or kg]; less_damping, less_friction and less_stiffness, the share of the model's value that
the machine lacks [1]; gravity_compensation, the share of the weight that the firmware carries [1].
"""

from __future__ import annotations

from functools import partial

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import Mechanism, Structure, joint_of
from hidden_plants.strangers.plant import Plant, State
from hidden_plants.strangers.stranger import Stranger


def _springs(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    stiff = (stranger.design.peak / stranger.travel).tolist()
    rests = (rng.uniform(-0.3, 0.3, len(stiff)) * stranger.travel).tolist()
    return [
        Structure("joint_stiffness", (joint,), 0.05 * size, 2.0 * size, {"rest": rest})
        for joint, size, rest in zip(stranger.joints, stiff, rests, strict=True)
    ]


def _tune_spring(plant: Plant, effect: Effect) -> None:
    i, stiffness = joint_of(plant, effect.elements[0]), effect.parameters["size"]
    rest = effect.parameters["rest"]

    def act(state: State) -> None:
        state.torque[i] -= stiffness * (float(state.data.qpos[i]) - rest)

    plant.body_devices.append(lambda: act)


def _rotors(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    return [
        Structure("armature", (joint,), 0.1 * inertia, 4.0 * inertia)
        for joint, inertia in zip(stranger.joints, stranger.design.inertia.tolist(), strict=True)
    ]


def _tune_rotor(plant: Plant, effect: Effect) -> None:
    plant.model.dof_armature[joint_of(plant, effect.elements[0])] += effect.parameters["size"]


def _less(field: str, stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    values, size = getattr(stranger.design, field), 0.1 if field == "stiffness" else 0.3
    return [
        Structure(f"less_{field}", (joint,), size, 1.0)
        for joint, value in zip(stranger.joints, values, strict=True)
        if value > 0.0
    ]


def _tune_less(field: str, plant: Plant, effect: Effect) -> None:
    getattr(plant.model, field)[joint_of(plant, effect.elements[0])] *= (
        1.0 - effect.parameters["size"]
    )


def _weight(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind != "servos":
        return []
    return [Structure("gravity_compensation", stranger.actuators, 0.2, 1.0)]


def _tune_weight(plant: Plant, effect: Effect) -> None:
    plant.model.body_gravcomp[1:] = effect.parameters["size"]
    plant.compensates = True


MECHANISMS = (
    Mechanism("joint_stiffness", _springs, _tune_spring),
    Mechanism("armature", _rotors, _tune_rotor),
    Mechanism("less_damping", partial(_less, "damping"), partial(_tune_less, "dof_damping")),
    Mechanism("less_friction", partial(_less, "friction"), partial(_tune_less, "dof_frictionloss")),
    Mechanism("less_stiffness", partial(_less, "stiffness"), partial(_tune_less, "jnt_stiffness")),
    Mechanism("gravity_compensation", _weight, _tune_weight),
)
