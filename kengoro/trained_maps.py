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


def nominal_model(scene: Path | str | None = None) -> NominalModel:
    """Nominal model of a robot for the agent: names, limits, topology and lengths.

    The muscles of Kengoro's arm are mapped in its four groups, those of another robot in one.

    Args:
        scene: MJCF file of the robot; Kengoro's arm if left out.
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
    """Default folder of trained maps, in the user's cache folder."""
    return user_cache_path("kengoro")


def trained_map(
    cache_dir: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
    scene: Path | str | None = None,
) -> JointMuscleMap:
    """Joint-muscle map of a nominal model, read from a file or trained and kept there.

    Args:
        cache_dir: folder of trained maps; the user's cache folder if left out.
        progress: called with the name of a group and the share done, 0 to 1.
        scene: MJCF file of the robot; Kengoro's arm if left out.
    """
    from jmm_agent.mapping.training import load_or_train

    folder = default_cache() if cache_dir is None else cache_dir
    return load_or_train(nominal_model(scene), MAP_SEED, folder, progress=progress)[0]
