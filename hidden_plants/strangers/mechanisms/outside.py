"""Effects that no single cause of a catalogue expresses.

Amplitudes: cogging [N or N m]; catching_tendon [N]; rubbing_tendons, the friction between two
tendons over the root of the product of their tensions [1]; hard_stop, its distance from a point
that is beyond the motion by a tenth of the travel [rad or m]; thermal_drift [unit of the sensor],
which a sensor approaches as it warms up; crosstalk, the share of another reading's deviation, each
over its range [1].
"""

from __future__ import annotations

from math import copysign, exp, sin

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.drives import tendon_lengths
from hidden_plants.strangers.mechanisms.mechanism import (
    Mechanism,
    Structure,
    index_of,
    joint_of,
    limits,
    sign,
    size_of,
)
from hidden_plants.strangers.plant import Plant, Readings, State, travels
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats


def _cogging(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    found = []
    scales = zip(stranger.joints, stranger.design.peak, stranger.travel, strict=True)
    for joint, peak, travel in scales:
        periods = round(float(rng.uniform(4.0, 12.0) * 2 * np.pi / travel), 4)
        shape = {"periods": periods, "phase": round(rng.uniform(0.0, 6.28), 3)}
        found.append(Structure("cogging", (joint,), 0.05 * float(peak), float(peak), shape))
    return found


def _tune_cogging(plant: Plant, effect: Effect) -> None:
    i, shape = joint_of(plant, effect.elements[0]), effect.parameters

    def act(state: State) -> None:
        angle = shape["periods"] * float(state.data.qpos[i]) + shape["phase"]
        state.torque[i] += shape["size"] * sin(angle)

    plant.body_devices.append(lambda: act)


class Catch:
    """A knot that catches where a tendon passes a length, and slips above a force."""

    def __init__(self, index: int, length: float, force: float, stiffness: float) -> None:
        self.index, self.length, self.force, self.stiffness = index, length, force, stiffness
        self.side, self.held = 0.0, False

    def __call__(self, state: State) -> None:
        """Add the force of the caught knot to the pull."""
        beyond = float(state.position[self.index]) - self.length
        side = copysign(1.0, beyond)
        if not self.held and self.side and side != self.side:
            self.held = True
        if self.held and self.stiffness * abs(beyond) > self.force:
            self.held = False
        if self.held:
            state.pull[self.index] -= self.stiffness * beyond
        self.side = side


def _catches(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    found = []
    path = stranger.paths[0]
    postures = path.at(np.arange(0.0, path.duration, 0.05))
    lengths = tendon_lengths(stranger.model, postures)
    for i, (tendon, limit) in enumerate(zip(stranger.tendons, limits(stranger), strict=False)):
        shape = {
            "length": float(np.quantile(lengths[:, i], rng.uniform(0.35, 0.65))),
            "stiffness": 5.0 * float(abs(stranger.law.position[i])),
        }
        size, most = 0.05 * float(limit), 0.4 * float(limit)
        found.append(Structure("catching_tendon", (tendon,), size, most, shape))
    return found


def _tune_catch(plant: Plant, effect: Effect) -> None:
    i, shape = index_of(plant, effect.elements[0]), effect.parameters
    plant.pull_devices.append(lambda: Catch(i, shape["length"], shape["size"], shape["stiffness"]))


class Rub:
    """Two tendons that rub: each slows the other in proportion to the root of both tensions."""

    def __init__(self, one: int, other: int, share: float, travel: float) -> None:
        self.one, self.other, self.share, self.travel, self.bend = one, other, share, travel, 0.0

    def __call__(self, state: State) -> None:
        """Drag both tendons along with each other."""
        speed = float(state.velocity[self.one] - state.velocity[self.other])
        product = float(state.force[self.one]) * float(state.force[self.other])
        end = copysign(self.share * max(0.0, product) ** 0.5, speed)
        self.bend = end + (self.bend - end) * exp(-abs(speed) * state.step / self.travel)
        state.pull[self.one] -= self.bend
        state.pull[self.other] += self.bend


def _rubs(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    """Pairs of tendons of different joints; those of one joint always rub at its own speed."""
    pairs = [
        (a.name, b.name) for a in stranger.routes for b in stranger.routes if a.joint < b.joint
    ]
    return [Structure("rubbing_tendons", pair, 0.05, 0.4) for pair in pairs]


def _tune_rub(plant: Plant, effect: Effect) -> None:
    one, other = (index_of(plant, name) for name in effect.elements)
    travel = float(plant.bristle[one])
    plant.pull_devices.append(lambda: Rub(one, other, effect.parameters["size"], travel))


def _stops(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    found = []
    for i, (joint, travel) in enumerate(zip(stranger.joints, stranger.travel, strict=True)):
        side = sign(rng)
        stops = np.concatenate([path.stops[i] for path in stranger.paths])
        end = float(side * (side * stops).max()) + 0.1 * side * float(travel)
        shape = {"side": side, "end": end}
        shape["stiffness"] = 40.0 * float(stranger.design.peak[i] / travel)
        found.append(Structure("hard_stop", (joint,), 0.15 * travel, 0.5 * travel, shape))
    return found


def _tune_stop(plant: Plant, effect: Effect) -> None:
    i, shape = joint_of(plant, effect.elements[0]), effect.parameters
    side, stiffness = shape["side"], shape["stiffness"]
    at = shape["end"] - side * shape["size"]
    damping = 0.5 * float(np.sqrt(stiffness * plant.stranger.design.inertia[i]))

    def act(state: State) -> None:
        depth = side * (float(state.data.qpos[i]) - at)
        if depth > 0.0:
            push = stiffness * depth + damping * side * float(state.data.qvel[i])
            state.torque[i] -= side * max(0.0, push)

    plant.body_devices.append(lambda: act)


def _ranges(stranger: Stranger) -> dict[str, float]:
    """Usual range of each sensor's reading."""
    own = {"position": stranger.travel, "velocity": 2.0 * stranger.design.speed}
    if stranger.routes:
        own["length"] = travels(stranger)
    own |= {"force": 0.5 * limits(stranger), "effort": 0.5 * limits(stranger)}
    return {s.name: float(own[s.kind][s.index]) for s in stranger.sensors}


def _drifts(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    seconds = stranger.traits.seconds
    found = []
    for name, size in _ranges(stranger).items():
        shape = {"sign": sign(rng), "time": round(seconds * rng.uniform(0.3, 0.8), 3)}
        found.append(Structure("thermal_drift", (name,), 0.02 * size, 0.2 * size, shape))
    return found


def _tune_drift(plant: Plant, effect: Effect) -> None:
    name, slow = effect.elements[0], effect.parameters["time"]

    def change(readings: Readings, time: Floats) -> None:
        warm = 1.0 - np.exp(-time / slow)
        readings[name] = readings[name] + size_of(effect) * warm

    plant.reading_effects.append(change)


def _crosstalks(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    ranges = _ranges(stranger)
    names = list(ranges)
    found = []
    for i, name in enumerate(names):
        before = _encoder_before(stranger, name)
        others = [k for k in range(len(names)) if k != i and names[k] != before]
        if others:
            source = names[int(rng.choice(others))]
            shape = {"sign": sign(rng), "ratio": ranges[name] / ranges[source]}
            found.append(Structure("crosstalk", (name, source), 0.02, 0.4, shape))
    return found


def _encoder_before(stranger: Stranger, name: str) -> str | None:
    """Encoder of the joint before that of an encoder: the sum of both is a coupled reading."""
    [sensor] = [one for one in stranger.sensors if one.name == name]
    if sensor.kind != "position":
        return None
    parent = stranger.skeleton.links[sensor.index].parent
    found = [s.name for s in stranger.sensors if s.kind == "position" and s.index == parent]
    return found[0] if found else None


def _tune_crosstalk(plant: Plant, effect: Effect) -> None:
    receiver, source = effect.elements
    factor = size_of(effect) * effect.parameters["ratio"]

    def change(readings: Readings, time: Floats) -> None:
        added = readings[source] - readings[source][0]
        readings[receiver] = readings[receiver] + factor * added

    plant.reading_effects.append(change)


MECHANISMS = (
    Mechanism("cogging", _cogging, _tune_cogging),
    Mechanism("catching_tendon", _catches, _tune_catch),
    Mechanism("rubbing_tendons", _rubs, _tune_rub),
    Mechanism("hard_stop", _stops, _tune_stop),
    Mechanism("thermal_drift", _drifts, _tune_drift),
    Mechanism("crosstalk", _crosstalks, _tune_crosstalk),
)
