"""A small nominal model in NumPy: a serial chain of six hinges and eight straight muscles."""

from itertools import pairwise

import numpy as np

from jmm_agent.nominal_model import NominalModel

JOINTS = ("base_yaw", "base_pitch", "mid_roll", "mid_pitch", "tip_pitch", "tip_yaw")
AXES = np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
OFFSETS = 0.1 * np.array([[0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 0], [0, 0, 1], [0, 0, 0]])
GROUPS = {"base": JOINTS[:2], "mid": JOINTS[2:4], "tip": JOINTS[4:]}
# Points of each muscle on links; link k follows joint k - 1, link 0 is the ground.
MUSCLES = {
    "base_front": ((0, (0.06, 0.01, -0.02)), (2, (0.04, 0.02, 0.06))),
    "base_left": ((0, (-0.03, 0.06, -0.02)), (2, (0.01, 0.05, 0.05))),
    "base_right": ((0, (-0.03, -0.06, -0.02)), (2, (-0.02, -0.04, 0.05))),
    "mid_front": ((2, (0.05, 0.00, 0.02)), (4, (0.04, 0.02, 0.04))),
    "mid_back": ((1, (-0.05, 0.02, -0.03)), (2, (-0.05, 0.01, 0.05)), (4, (-0.04, 0.0, 0.03))),
    "mid_long": ((0, (0.02, -0.07, -0.02)), (4, (0.02, -0.05, 0.03))),
    "tip_front": ((4, (0.05, 0.01, 0.02)), (6, (0.03, 0.02, 0.05))),
    "tip_back": ((4, (-0.05, -0.02, 0.02)), (6, (-0.03, 0.01, 0.05))),
}


def crosses() -> np.ndarray:
    """Whether muscle i crosses joint j (8, 6); joint k lies between the links k and k + 1."""
    ends = [sorted(link for link, _ in muscle) for muscle in MUSCLES.values()]
    return np.array([[e[0] <= k < e[-1] for k in range(len(JOINTS))] for e in ends])


def raw_lengths(q: np.ndarray, displaced: np.ndarray | None = None) -> np.ndarray:
    """Lengths (B, 8) [m] of the muscles at postures (B, 6) [rad], with displaced points (8, 9)."""
    rotation = np.broadcast_to(np.eye(3), (len(q), 3, 3))
    origin = np.zeros((len(q), 3))
    links = [(rotation, origin)]
    for k, (axis, offset) in enumerate(zip(AXES, OFFSETS, strict=True)):
        origin = origin + rotation @ offset
        cross = np.cross(np.eye(3), axis)
        sine, cosine = np.sin(q[:, k])[:, None, None], np.cos(q[:, k])[:, None, None]
        rotation = rotation @ (np.eye(3) - sine * cross + (1 - cosine) * cross @ cross)
        links.append((rotation, origin))
    lengths = []
    shifts = np.zeros((8, 3, 3)) if displaced is None else displaced.reshape(8, 3, 3)
    for muscle, moved in zip(MUSCLES.values(), shifts, strict=True):
        own = [
            (k, np.array(point) + shift) for (k, point), shift in zip(muscle, moved, strict=False)
        ]
        points = [links[k][0] @ point + links[k][1] for k, point in own]
        lengths.append(sum(np.linalg.norm(b - a, axis=1) for a, b in pairwise(points)))
    return np.stack(lengths, axis=1)


def relative_lengths(q: np.ndarray) -> np.ndarray:
    """Lengths (B, 8) [m] relative to q = 0."""
    return raw_lengths(q) - raw_lengths(np.zeros((1, len(JOINTS))))


def point_sensitivities(q: np.ndarray) -> np.ndarray:
    """How lengths change with displaced points (B, 8, 9) [1], by differences."""
    found = np.zeros((len(q), 8, 9))
    for number in range(9):
        displaced = np.zeros((8, 9))
        displaced[:, number] = 1e-6
        found[:, :, number] = (raw_lengths(q, displaced) - raw_lengths(q, -displaced)) / 2e-6
    return found


def nominal_model(**changes: object) -> NominalModel:
    """Nominal model of the chain, with fields replaced for tests of its checks."""
    fields: dict = {
        "joints": JOINTS,
        "lower": np.deg2rad([-40, -30, -20, -60, -50, -30]),
        "upper": np.deg2rad([40, 40, 30, 50, 50, 20]),
        "muscles": tuple(MUSCLES),
        "crosses": crosses(),
        "lengths": relative_lengths,
        "groups": GROUPS,
    }
    return NominalModel(**(fields | changes))
