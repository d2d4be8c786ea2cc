"""Kengoro's arm: its environments, scene, camera and markers; and postures of any robot."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from pathlib import Path
from typing import Any, get_args

import gymnasium as gym
import numpy as np

from jmm_agent.types import Floats
from jmm_agent.updaters.vision_options import HandKind
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.can_shape import CanKind
from kengoro.errors import UsageError
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures import NoCanMarker, NoHandMarker
from kengoro_env.departures.choice import chosen_departures
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.nominal_model import NominalArm

CAMERA = Camera.from_fovy(640, 480, radians(45.0))
"""The camera of the nominal model; that of an actual robot differs a little."""

HAND, CAN = 0, 1
SIDES = {HAND: 0.050, CAN: 0.036}
"""Side of each marker [m] by its id."""

NO_END = 10_000_000
"""Steps of an episode that never ends."""


def arm_scene() -> Path:
    """MJCF file of the arm's nominal model."""
    return asset_path(ARM)


def check_seed(seed: int) -> None:
    """Raise a `UsageError` if the seed of a robot, or of samples, is no integer or negative."""
    if not isinstance(seed, int | np.integer):
        raise UsageError(f"The seed is {seed!r}, but seeds are integers.")
    if seed < 0:
        raise UsageError(f"The seed is {seed}, but seeds are not negative.")


def check_hand(hand: object) -> None:
    """Raise a `UsageError` if the kind of hand is neither "marker" nor "seen"."""
    _check_kind("hand", hand, get_args(HandKind))


def _check_kind(what: str, kind: object, known: tuple[str, ...]) -> None:
    if not isinstance(kind, str) or kind not in known:
        raise UsageError(f"The {what} is {kind!r}; it must be 'marker' or 'seen'.")


def check_can(can: object) -> None:
    """Raise a `UsageError` if the kind of can is neither "marker" nor "seen"."""
    _check_kind("can", can, get_args(CanKind))


def make_env(
    task: str,
    robot_seed: int | None = None,
    *,
    hand: HandKind = "marker",
    can: CanKind = "marker",
    camera: bool | None = None,
    departures: Sequence[Departure] | None = None,
    **options: Any,
) -> gym.Env[Any, Any]:
    """An environment of Kengoro's arm.

    Args:
        task: "CanGrasp", "Posture" or "Elbow".
        robot_seed: which actual robot; None for the nominal model, without departures.
        hand: whether the hand carries its marker ("marker") or none ("seen").
        can: whether the can carries its marker ("marker") or none ("seen").
        camera: whether the robot has its camera, from which the agent learns; None: if the task's
            scene has one.
        departures: departures of the robot from the nominal model, in place of ``robot_seed``.
        **options: of `gymnasium.make`, such as ``max_episode_steps``, except for ``model``.

    Raises:
        UsageError: the task is unknown, the seed is negative, there is no such hand or can, or a
            model is given.
        KengoroError: another argument cannot be used.
    """
    check_hand(hand)
    check_can(can)
    known = [spec.name for spec in gym.registry.values() if spec.namespace == "Kengoro"]
    if task not in known:
        raise UsageError(f"There is no task {task!r}; there are: {', '.join(known)}.")
    if options.get("model") is not None:
        raise UsageError(
            "make_env has no model: give it to gymnasium.make, such as "
            f"gymnasium.make('kengoro_env:Kengoro/{task}-v0', model=model)."
        )
    check_seed(robot_seed or 0)
    chosen = chosen_departures(robot_seed, departures)
    if hand == "seen":
        chosen = (*chosen, NoHandMarker(removed=True))
    if can == "seen":
        chosen = (*chosen, NoCanMarker(removed=True))
    return gym.make(f"Kengoro/{task}-v0", departures=chosen, camera=camera, **options)


def sample_postures(
    scene: Path | str,
    count: int,
    seed: int = 0,
    share: float = 0.6,
    folders: Sequence[Path | str] = (),
) -> Floats:
    """Postures of the robot in an MJCF file, uniform within the middle of the joint ranges.

    Args:
        scene: MJCF file.
        count: number of postures N.
        seed: of the samples.
        share: which share of each joint's range, about its middle.
        folders: further folders whose files the model may include or load.

    Returns:
        Joint angles, shape (N, n) [rad].
    """
    return sample_within(NominalArm(scene, folders), count, seed, share)


def sample_within(arm: NominalArm, count: int, seed: int = 0, share: float = 0.6) -> Floats:
    """Postures of a nominal model, as `sample_postures`, shape (N, n) [rad]."""
    check_seed(seed)
    middle, half = 0.5 * (arm.lower + arm.upper), 0.5 * share * (arm.upper - arm.lower)
    rng = np.random.default_rng(seed)
    return rng.uniform(middle - half, middle + half, (count, len(arm.joints)))


def shuffled_postures(seed: int) -> Floats:
    """The posture set, shape (N, n) [rad], in the random order of a robot.

    Learn from its beginning and test on its end, so that no posture serves both.
    """
    check_seed(seed)
    postures = posture_set()
    return postures[np.random.default_rng([seed, 1]).permutation(len(postures))]
