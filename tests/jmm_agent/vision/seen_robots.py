"""Small robots drawn from the prior of a map's error, whose hand is seen in part.

They have eight muscles in two groups and four joints. The position of the hand is measured and its
rotation is not, so that one combination of joints is known by the lengths only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from jmm_agent.mapping.group_map import METRES, GroupMap
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, RidgeRule, Rule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions, VisionUpdater
from jmm_agent.vision.hand_error import HandPostures
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.pose_covariance import UNKNOWN

JOINTS, MUSCLES = ("a", "b", "c", "d"), tuple(f"m{number}" for number in range(8))
LIMITS = np.array([[-0.8, 0.8], [-0.5, 1.0], [-0.6, 0.6], [0.1, 1.2]])
WIDE = np.column_stack([LIMITS[:, 0] - 1.0, LIMITS[:, 1] + 1.0])
"""Limits beyond which no posture of the tests is [rad]."""
LEVER = np.array([[0.3, 0.1, 0.0, 0.2], [0.0, 0.25, 0.1, -0.1], [0.1, 0.0, 0.3, 0.15]])
"""How the hand moves with the joints [m/rad]."""
PRIOR = PriorOptions(zero_posture=0.1)
POSITION_NOISE = 0.003
"""Of the hand, standard deviation [m]; that of what is measured is far below it."""
ONLY_POSITION = np.diag(np.repeat([1e-10, UNKNOWN], 3))


def make_map() -> JointMuscleMap:
    """The nominal map; lengths change by some 30 mm, with smooth moment arms."""
    rng = np.random.default_rng(5)

    def group(name: str, joints: list[int], muscles: list[int]) -> GroupMap:
        n, k, hidden = len(joints), len(muscles), 16
        return GroupMap(
            name,
            np.array(joints),
            np.array(muscles),
            np.zeros(n),
            np.ones(n),
            rng.normal(size=(hidden, n)),
            rng.normal(size=hidden),
            40.0 * rng.normal(size=(k, hidden)),
            rng.normal(size=k),
        )

    groups = (group("near", [1, 0], [6, 0, 3]), group("far", [3, 1, 2], [1, 4, 2, 7, 5]))
    return JointMuscleMap(JOINTS, MUSCLES, groups)


def postures(count: int, seed: int = 0) -> Floats:
    """Postures (count, 4) [rad] inside the limits."""
    return np.random.default_rng([seed, 78]).uniform(*LIMITS.T, (count, 4))


def picture(q: Floats) -> Floats:
    """Pose (4, 4) of the hand at joint angles (4,) [rad]."""
    pose = np.eye(4)
    pose[:3, 3] = LEVER @ q
    return pose


def marker_residual(q: Floats, pose: Floats, frames: object = None) -> tuple[Floats, Floats]:
    """Error of the hand's position, without one of its rotation."""
    return np.concatenate([LEVER @ q - pose[:3, 3], np.zeros(3)]), np.vstack(
        [LEVER, np.zeros((3, 4))]
    )


class SeenRobot:
    """A robot of a seed.

    Args:
        seed: of its errors and of the noise.
        larger: by how many times they are larger than the prior says [1].
    """

    def __init__(self, seed: int, larger: float = 1.0) -> None:
        self.rng = np.random.default_rng([seed, 21])
        widths = PriorOptions(
            offset=larger * PRIOR.zeroed_offset, shape=larger * PRIOR.zeroed_shape
        )
        prior, layers = MapPrior(make_map(), postures(100, 8), widths), {}
        for rank, group in enumerate(prior.map.groups):
            change = self.rng.standard_normal((1 + group.b1.size, group.b2.size)) / METRES
            layers[group.name] = prior._layer(rank, group, change)
        self.map = prior.map.with_output_layers(layers)
        self.zero = larger * PRIOR.zero_posture * self.rng.standard_normal(4)

    def lengths(self, q: Floats) -> Floats:
        """Lengths (8,) or (K, 8) [m] without noise."""
        return np.asarray(self.map.lengths(q) - make_map().lengths(self.zero))

    def observation(self, q: Floats, **more: Any) -> MarkerObservation:
        """A look at joint angles (4,) [rad], with noise; ``more`` replaces parts of it."""
        pose = picture(q)
        pose[:3, 3] += POSITION_NOISE * self.rng.standard_normal(3)
        lengths = self.lengths(q) + PRIOR.noise * self.rng.standard_normal(len(MUSCLES))
        guess = q + 0.05 * self.rng.standard_normal(4)
        return MarkerObservation(pose, lengths, guess, covariance=ONLY_POSITION)._replace(**more)


def hand_postures() -> HandPostures:
    """Postures by which the hand's error is judged."""
    return HandPostures(postures(12, 31), np.tile(LEVER, (12, 1, 1)), PRIOR.zero_posture)


def updater(rule: Rule | None = None, judged: bool = True, **options: Any) -> VisionUpdater:
    """A Vision Updater of such robots, without loads."""
    prior, start = MapPrior(make_map(), postures(100, 8), PRIOR), make_map()
    rng = np.random.default_rng(0)
    learner = Learner(start, LIMITS, rule or RidgeRule(prior), BatchOptions(), rng)
    chosen = VisionOptions(
        **{"lengths": "l", "threshold": 9.0, "position_residual": 0.1, **options}
    )
    given = hand_postures() if judged else None
    return VisionUpdater(learner, prior, marker_residual, WIDE, chosen, None, given)


def see(vision: VisionUpdater, observation: MarkerObservation) -> Any:
    """Let the updater learn from a look; returns the result."""
    more = {"covariance": observation.covariance, "joint_angles": observation.joint_angles}
    tensions = np.full(len(MUSCLES), 50.0)
    return vision.seen(
        observation.pose,
        observation.guess,
        observation.lengths,
        observation.lengths,
        tensions,
        **more,
    )


def map_of(vision: VisionUpdater) -> JointMuscleMap:
    """The map as learned so far."""
    return vision._learner.map
