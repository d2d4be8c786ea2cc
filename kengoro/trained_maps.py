"""The joint-muscle map of a nominal model: trained once, then read from a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from platformdirs import user_cache_path

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.nominal_model import NominalModel
from kengoro_env.assets import asset_path
from kengoro_env.names import GROUP_JOINTS, JOINTS
from kengoro_env.robot.nominal_model import NominalArm

ARM = "mjcf/kengoro_arm/arm.xml"
MAP_SEED = 0


def nominal_model(scene: Path | None = None) -> NominalModel:
    """What the agent is told of the robot in ``scene`` (the arm if left out).

    The map has a group for each of the arm's; of another robot's joints it has one for all.
    """
    arm = NominalArm(asset_path(ARM) if scene is None else scene)
    groups = {"all": arm.joints}
    if set(arm.joints) <= set(JOINTS):
        shared = {n: tuple(j for j in own if j in arm.joints) for n, own in GROUP_JOINTS.items()}
        groups = {name: joints for name, joints in shared.items() if joints}
    return NominalModel(
        arm.joints, arm.lower, arm.upper, arm.muscles, arm.crosses, arm.lengths, groups
    )


def default_cache() -> Path:
    """Folder of trained maps in the user's cache folder."""
    return user_cache_path("kengoro")


def trained_map(
    cache_dir: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
    scene: Path | None = None,
) -> JointMuscleMap:
    """The map of the drawing of ``scene`` (the arm if left out), read from ``cache_dir`` or trained
    and kept there."""
    from jmm_agent.mapping.training import load_or_train

    folder = default_cache() if cache_dir is None else cache_dir
    return load_or_train(nominal_model(scene), MAP_SEED, folder, progress=progress)[0]
