"""Traits of a machine: its kind, size, sensors and clock, before any part is dimensioned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MACHINE_KINDS = ("motors", "servos", "tendons", "efforts")
"""Torque motors in open loop, position servos, tendons with stiffness control, and logs of torques
of a machine in closed loop."""
SHARES = (0.2, 0.35, 0.3, 0.15)
"""Probabilities of the kinds."""
REACH = (0.06, 2.0)
"""Reach of the smallest and of the largest machine [m]: a finger and an industrial arm."""
RATES = (20.0, 25.0, 30.0, 50.0, 60.0, 100.0, 125.0, 200.0, 250.0, 500.0, 1000.0)
"""Sampling rates of logs [Hz]."""
LEAST_RATE_OF_EFFORTS = 100.0
"""Lowest sampling rate of a log of torques [Hz], which has to resolve accelerations."""
MOST_ROWS = 20000.0
"""Largest number of readings of all channels of a log."""


@dataclass(frozen=True)
class Traits:
    """Traits of one machine.

    Attributes:
        kind: one of `MACHINE_KINDS`.
        joints: number of joints.
        reach: sum of the lengths of its links [m].
        branches: whether the chain of links forks after its first link.
        slides: indices of the joints that slide.
        up: direction of gravity's opposite in the frame of the base.
        rate: sampling rate [Hz].
        position_bits, force_bits: resolution of positions and forces.
        noise: standard deviation of a position's white noise over its range [1]. It is larger in
            open loop, where mismatches add up to many noises and are not linear any more.
        force_noise: of a force's white noise over its limit [1].
        noise_stated: whether the study states the noise of its sensors.
        integrator: MuJoCo's integrator of the nominal model.
        tricky_defaults: whether the model's defaults differ from MuJoCo's, for all elements.
        modelled_friction: whether the nominal model has dry friction at its joints.
        tool: whether a further body is fixed to the last link.
        velocities, forces: whether joint velocities and actuator forces are measured.
        wrapping: whether tendons wrap around pulleys at the joints.
        remote: whether tendons run from the base over all joints before their own.
        episodes: number of episodes.
        seconds: length of the log [s].
    """

    kind: str
    joints: int
    reach: float
    branches: bool
    slides: tuple[int, ...]
    up: tuple[float, float, float]
    rate: float
    position_bits: int
    force_bits: int
    noise: float
    force_noise: float
    noise_stated: bool
    integrator: str
    tricky_defaults: bool
    modelled_friction: bool
    tool: bool
    velocities: bool
    forces: bool
    wrapping: bool
    remote: bool
    episodes: int
    seconds: float


def sample_traits(rng: np.random.Generator, seconds: float = 10.0) -> Traits:
    """Sample the traits of a machine.

    Args:
        rng: random numbers.
        seconds: length of the log [s].
    """
    kind = str(rng.choice(MACHINE_KINDS, p=SHARES))
    joints = int(rng.integers(1, 4 if kind == "tendons" else 8))
    tendons = kind == "tendons"
    sliding = rng.random(joints) < (0.0 if tendons else 0.12)
    rate = _rate(rng, kind, joints, seconds)
    ups = ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    return Traits(
        kind=kind,
        joints=joints,
        reach=float(np.exp(rng.uniform(*np.log(REACH)))),
        branches=bool(joints >= 3 and rng.random() < 0.3),
        slides=tuple(int(i) for i in np.flatnonzero(sliding)),
        up=ups[int(rng.integers(len(ups)))],
        rate=rate,
        position_bits=int(rng.integers(8, 25)),
        force_bits=int(rng.integers(8, 17)),
        noise=float(10.0 ** rng.uniform(-4.0 if kind == "motors" else -4.7, -3.3)),
        force_noise=float(10.0 ** rng.uniform(-3.5, -2.3)),
        noise_stated=bool(rng.random() < 0.7),
        integrator=str(rng.choice(["Euler", "implicitfast", "RK4"])),
        tricky_defaults=bool(rng.random() < 0.6),
        modelled_friction=bool(rng.random() < 0.5),
        tool=bool(rng.random() < 0.3),
        velocities=bool(not tendons and kind != "efforts" and rng.random() < 0.25),
        forces=bool(tendons or (kind == "servos" and rng.random() < 0.5)),
        wrapping=bool(rng.random() < 0.4),
        remote=bool(rng.random() < 0.5),
        episodes=int(rng.choice([1, 2], p=[0.6, 0.4])),
        seconds=seconds,
    )


def _rate(rng: np.random.Generator, kind: str, joints: int, seconds: float) -> float:
    """Sample a rate that keeps the log small."""
    channels = 4 * joints if kind == "tendons" else 2 * joints
    most = MOST_ROWS / (channels * seconds)
    least = LEAST_RATE_OF_EFFORTS if kind == "efforts" else 0.0
    return float(rng.choice([rate for rate in RATES if least <= rate <= max(most, 100.0)]))
