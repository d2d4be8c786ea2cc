"""The joint-muscle map of a nominal model: trained once, then read from a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from platformdirs import user_cache_path

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.point_weights import load_or_compute
from jmm_agent.mapping.prior import PointWeights
from jmm_agent.nominal_model import NominalModel
from kengoro_env.assets import asset_path
from kengoro_env.names import GROUP_JOINTS, JOINTS
from kengoro_env.robot.nominal_model import NominalArm

ARM = "mjcf/kengoro_arm/arm.xml"
MAP_SEED = 0

Groups = Mapping[str, Sequence[str]]
"""The joints of each group of muscles, which has a network of its own, proximal to distal."""


def nominal_model(
    scene: Path | str | None = None,
    folders: Sequence[Path | str] = (),
    groups: Groups | None = None,
) -> NominalModel:
    """Nominal model of a robot for the agent: names, limits, topology and lengths.

    Args:
        scene: MJCF file of the robot; Kengoro's arm if left out.
        folders: further folders whose files the model may include or load.
        groups: the joints that each group of muscles owns, proximal to distal; if left out, the
            four groups of Kengoro's arm, and one group for another robot.
    """
    return model_of(NominalArm(asset_path(ARM) if scene is None else scene, folders), groups)


def model_of(arm: NominalArm, groups: Groups | None = None) -> NominalModel:
    """Nominal model for the agent of a geometric model.

    Args:
        arm: the geometric model.
        groups: as in `nominal_model`.
    """
    if groups is None:
        groups = {"all": arm.joints}
        if set(arm.joints) <= set(JOINTS):
            shared = {name: _those(own, arm.joints) for name, own in GROUP_JOINTS.items()}
            groups = {name: joints for name, joints in shared.items() if joints}
    owned = {name: tuple(joints) for name, joints in groups.items()}
    return NominalModel(
        arm.joints,
        arm.lower,
        arm.upper,
        arm.muscles,
        arm.crosses,
        arm.lengths,
        owned,
        arm.point_sensitivities,
    )


def _those(joints: Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    return tuple(joint for joint in joints if joint in known)


def default_cache() -> Path:
    """Default folder of trained maps, in the user's cache folder."""
    return user_cache_path("kengoro")


def trained_map(
    cache_dir: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
    scene: Path | str | None = None,
    folders: Sequence[Path | str] = (),
    groups: Groups | None = None,
) -> JointMuscleMap:
    """Joint-muscle map of a nominal model, read from a file or trained and kept there.

    Args:
        cache_dir: folder of trained maps; the user's cache folder if left out.
        progress: called with the name of a group and the share done, 0 to 1.
        scene: MJCF file of the robot; Kengoro's arm if left out.
        folders: further folders whose files the model may include or load.
        groups: as in `nominal_model`.
    """
    return map_of(nominal_model(scene, folders, groups), cache_dir, progress)


def map_of(
    nominal: NominalModel,
    cache_dir: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> JointMuscleMap:
    """Joint-muscle map of a nominal model, as `trained_map`.

    Args:
        nominal: the nominal model.
        cache_dir: folder of trained maps; the user's cache folder if left out.
        progress: called with the name of a group and the share done, 0 to 1.
    """
    from jmm_agent.mapping.training import load_or_train

    folder = default_cache() if cache_dir is None else cache_dir
    return load_or_train(nominal, MAP_SEED, folder, progress=progress)[0]


def points_of(
    jmm: JointMuscleMap, nominal: NominalModel, cache_dir: Path | None = None
) -> PointWeights | None:
    """What displaced points of attachment do to the lengths of a map, read or computed and kept.

    Args:
        jmm: the map that was trained on the nominal model.
        nominal: the nominal model.
        cache_dir: folder of trained maps; the user's cache folder if left out.

    Returns:
        See `jmm_agent.mapping.point_weights`; None for another map than the model's.
    """
    return load_or_compute(jmm, nominal, default_cache() if cache_dir is None else cache_dir)
