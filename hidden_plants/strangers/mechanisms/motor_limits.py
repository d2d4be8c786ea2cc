"""Motors and servos with less force at speed, with slow set points, and with dead zones.

Amplitudes: torque_speed_curve, the share of the limit that is lost at the largest speed of the
planned motion [1]; speed_limit, the largest planned speed over the limit of the set point [1];
dead_zone, half of its width [rad or m of a servo's error, N or N m of a motor's command].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import Mechanism, Structure, index_of
from hidden_plants.strangers.plant import Plant, State
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats

LIMITS = 1.3
"""Largest planned speed over a limit from which on the limit shapes the motion. A higher limit only
delays each command by a part of the interval between commands."""


def _curves(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind not in ("motors", "servos"):
        return []
    speeds = stranger.design.speed.tolist()
    return [
        Structure("torque_speed_curve", (f"m_{name}",), 0.6, 3.0, {"speed": speed})
        for name, speed in zip(stranger.moved, speeds, strict=True)
    ]


def _tune_curve(plant: Plant, effect: Effect) -> None:
    i = index_of(plant, effect.elements[0])
    drop, high, low = _drop(effect), float(plant.law.high[i]), float(plant.law.low[i])

    def act(state: State) -> None:
        lost = drop * float(state.velocity[i])
        most = high * min(max(1.0 - lost, 0.0), 1.0)
        least = low * min(max(1.0 + lost, 0.0), 1.0)
        state.force[i] = min(max(float(state.force[i]), least), most)

    plant.law_devices.append(lambda: act)


def _drop(effect: Effect) -> float:
    """Share of the limit that is lost per speed [s/rad or s/m]."""
    return effect.parameters["size"] / effect.parameters["speed"]


class Profile:
    """Set point of a servo that follows its command at a limited speed."""

    def __init__(self, index: int, most: float, gain: float) -> None:
        self.index, self.most, self.gain = index, most, gain
        self.point: float | None = None

    def __call__(self, state: State) -> None:
        """Correct the force for the set point in place of the command."""
        command = float(state.command[self.index])
        before = command if self.point is None else self.point
        step = self.most * state.step
        self.point = before + min(max(command - before, -step), step)
        state.force[self.index] += self.gain * (self.point - command)


def _profiles(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind != "servos":
        return []
    speeds = stranger.design.speed.tolist()
    return [
        Structure("speed_limit", (f"m_{name}",), 1.5, 4.0, {"speed": speed}, LIMITS)
        for name, speed in zip(stranger.moved, speeds, strict=True)
    ]


def _slowness(effect: Effect) -> float:
    """Inverse of the largest speed of the set point [s/rad or s/m]."""
    return effect.parameters["size"] / effect.parameters["speed"]


def _tune_profile(plant: Plant, effect: Effect) -> None:
    i, most = index_of(plant, effect.elements[0]), 1.0 / _slowness(effect)
    gain = float(plant.law.gain[i])
    plant.law_devices.append(lambda: Profile(i, most, gain))


def _zones(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    sizes: Floats
    if stranger.traits.kind == "servos":
        sizes = stranger.travel
    elif stranger.traits.kind == "motors":
        sizes = 5.0 * stranger.design.peak
    else:
        return []
    return [
        Structure("dead_zone", (f"m_{name}",), 0.01 * size, 0.1 * size)
        for name, size in zip(stranger.moved, sizes.tolist(), strict=True)
    ]


def _tune_zone(plant: Plant, effect: Effect) -> None:
    i, half, law = index_of(plant, effect.elements[0]), effect.parameters["size"], plant.law
    gain, slope = float(law.gain[i]), float(law.position[i])

    def act(state: State) -> None:
        error = gain * float(state.command[i]) + slope * float(state.encoder[i])
        dead = half * (abs(slope) or gain)
        state.force[i] -= min(max(error, -dead), dead)

    plant.law_devices.append(lambda: act)


TRUE_SIZES: dict[str, Callable[[Effect], float]] = {
    "torque_speed_curve": _drop,
    "speed_limit": _slowness,
}
"""True sizes of effects whose amplitude is a share of something."""

MECHANISMS = (
    Mechanism("torque_speed_curve", _curves, _tune_curve),
    Mechanism("speed_limit", _profiles, _tune_profile),
    Mechanism("dead_zone", _zones, _tune_zone),
)
