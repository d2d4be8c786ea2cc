"""Posture set: postures in front of the body that the arm can hold and the camera can see.

Postures determine what can be learned: in most of the box of joint ranges, joints rest at their
stops and muscles saturate. As in the paper (sec. IV), each posture was checked for feasibility. A
posture belongs to the set if, in the nominal model,

* every joint is at least `STOP_MARGIN` away from its stops,
* tensions of 5 to `TENSION_LIMIT` N hold it against gravity (linear programme),
* each joint has, in both directions, a muscle with a moment arm of at least `MOMENT_ARM`,
* under stiffness control it sags by less than `SAG` (root mean square over the joints),
* the hand is in front of the body, its fingertips are above the table, and its marker is in the
  camera's frame, turned from it by at most `MARKER_TILT`.

``python -m kengoro_env.postures`` samples the set again and writes it to the assets.
"""

from __future__ import annotations

from functools import cache, lru_cache
from math import radians

import mujoco
import numpy as np

from kengoro_env.assets import asset_path
from kengoro_env.names import JOINTS
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot
from kengoro_env.types import Floats
from mjcf_sandbox.files import whole_file

STOP_MARGIN = radians(3.0)  # [rad]
TENSION_LIMIT = 150.0  # [N]
MOMENT_ARM = 0.012  # [m]
SAG = radians(3.0)  # [rad]
MARKER_TILT = radians(55.0)  # [rad]
FRAME_MARGIN = 50.0  # distance of the marker from the edge of the frame [pixels]
TABLE_CLEARANCE = 0.05  # height of the fingertips above the table [m]
TABLE_HEIGHT = -0.38  # [m]

RANGES_DEG: dict[str, tuple[float, float]] = {
    "neck_yaw": (-45, 20),
    "neck_pitch": (-18, 33),
    "neck_roll": (-12, 12),
    "sc_roll": (-22, 0),
    "sc_yaw": (-10, 10),
    "ac_roll": (-14, 5),
    "ac_pitch": (-9, 9),
    "sh_pitch": (-116, 26),
    "sh_roll": (-72, 2),
    "sh_yaw": (-45, 52),
    "elbow": (12, 114),
    "radioulnar": (-48, 48),
    "wrist_flex": (-38, 38),
    "wrist_dev": (-14, 19),
}
"""Box from which postures are sampled [deg], uniformly except for the shoulder's pitch; the neck is
turned to the hand."""


def least_tension(arms: Floats, gravity: Floats, least: float = 5.0, most: float = 400.0) -> float:
    """Largest tension [N] of the tensions that hold a posture, minimised; inf: none hold it.

    Args:
        arms: moment arms dl/dq (m, n) [m/rad].
        gravity: torques of gravity on the joints (n,) [N m].
        least: smallest tension of a muscle [N].
        most: largest tension of a muscle [N].
    """
    from scipy.optimize import linprog  # imported here because the import takes 0.3 s

    tendons, joints = arms.shape
    answer = linprog(
        np.append(np.zeros(tendons), 1.0),
        A_ub=np.hstack([np.eye(tendons), -np.ones((tendons, 1))]),
        b_ub=np.zeros(tendons),
        A_eq=np.hstack([arms.T, np.zeros((joints, 1))]),
        b_eq=gravity,
        bounds=[(least, most)] * tendons + [(0.0, None)],
        method="highs",
    )
    return float(answer.x[-1]) if answer.status == 0 else float("inf")


class PostureChecker:
    """Samples candidates for the posture set, and checks postures (14,) [rad]."""

    def __init__(self) -> None:
        scene = asset_path("mjcf/kengoro_arm/arm.xml")
        self.nominal = NominalArm(scene)
        self.robot = Robot(scene)
        self._low, self._high = np.radians([RANGES_DEG[joint] for joint in JOINTS]).T
        model = self.robot.model
        camera = model.camera("eye")
        self._size = model.cam_resolution[camera.id].astype(float)
        self._focal = self._size[1] / 2 / np.tan(radians(float(camera.fovy[0])) / 2)
        self._tips = [model.geom(name).id for name in ("index_distal", "ring_distal")]

    def candidate(self, rng: np.random.Generator) -> Floats:
        """Sample a posture from the box, with the neck turned roughly to the hand."""
        share = rng.uniform(size=len(JOINTS))
        pitch = JOINTS.index("sh_pitch")  # extremes are accepted rarely: sample them more often
        share[pitch] = rng.beta(0.6, 0.6)
        posture = self._low + share * (self._high - self._low)
        self._set_posture(posture)
        hand = self.robot.data.site("marker_hand").xpos - self.robot.model.body("neck_yaw_link").pos
        posture[0] = np.arctan2(hand[1], hand[0]) + rng.normal(0.0, radians(6.0))
        down = np.arctan2(0.188 - hand[2], np.hypot(hand[0], hand[1]) - 0.095)
        posture[1] = down - radians(30.0) + rng.normal(0.0, radians(5.0))
        return posture

    def _set_posture(self, posture: Floats) -> None:
        self.robot.data.qpos[:] = 0.0
        for joint, angle in zip(JOINTS, posture, strict=True):
            self.robot.data.joint(joint).qpos[0] = angle
        mujoco.mj_kinematics(self.robot.model, self.robot.data)
        mujoco.mj_camlight(self.robot.model, self.robot.data)

    def seen(self, posture: Floats) -> bool:
        """Whether the hand is in front of the body and above the table, with its marker in view."""
        self._set_posture(posture)
        data = self.robot.data
        marker, eye = data.site("marker_hand"), data.camera("eye")
        view = marker.xpos - eye.xpos
        x, y, z = view @ eye.xmat.reshape(3, 3)
        u, v = self._focal * x / -z, self._focal * y / -z
        half = self._size / 2 - FRAME_MARGIN
        facing = -(view / np.linalg.norm(view)) @ marker.xmat.reshape(3, 3)[:, 2]
        grip = data.site("grip").xpos
        lowest = min(data.geom_xpos[tip][2] for tip in self._tips)
        return bool(
            z < 0.0
            and abs(u) < half[0]
            and abs(v) < half[1]
            and facing > np.cos(MARKER_TILT)
            and 0.25 < np.linalg.norm(view) < 0.75
            and grip[0] > 0.15
            and grip[1] < 0.15
            and lowest > TABLE_HEIGHT + TABLE_CLEARANCE
        )

    def inside(self, posture: Floats) -> bool:
        """Whether every joint is away from its stops."""
        low, high = self.nominal.lower + STOP_MARGIN, self.nominal.upper - STOP_MARGIN
        return bool(np.all(posture > low) and np.all(posture < high))

    def strong(self, posture: Floats) -> bool:
        """Whether each joint has, in both directions, a muscle with a sufficient moment arm."""
        arms = self.nominal.moment_arms(posture)
        return bool(np.all(np.minimum(arms.max(axis=0), -arms.min(axis=0)) >= MOMENT_ARM))

    def holds(self, posture: Floats) -> bool:
        """Whether tensions of 5 to `TENSION_LIMIT` N hold the posture."""
        arms, gravity = self.nominal.moment_arms(posture), self.nominal.gravity(posture)
        return least_tension(arms, gravity, most=TENSION_LIMIT) <= TENSION_LIMIT

    def sag(self, posture: Floats) -> float:
        """Error of the nominal model under stiffness control [rad], root mean square."""
        target = self.nominal.lengths(posture)[0]
        self.robot.reset(posture, np.random.default_rng(0))
        for _ in range(75):
            self.robot.step(target)
        return float(np.sqrt(np.mean((self.robot.joint_angles - posture) ** 2)))

    def accepts(self, posture: Floats) -> bool:
        """Whether the posture belongs to the set. Cheap conditions come first."""
        return (
            self.inside(posture)
            and self.seen(posture)
            and self.strong(posture)
            and self.holds(posture)
            and self.sag(posture) < SAG
        )


@cache
def posture_set() -> Floats:
    """The shipped posture set (N, 14) [rad], read-only; columns are `JOINTS`."""
    table = np.loadtxt(asset_path("postures/kengoro_arm.csv"), delimiter=",", skiprows=1)
    postures = np.radians(table)
    postures.setflags(write=False)
    return postures


def postures_within(lower: Floats, upper: Floats) -> Floats:
    """The postures of the set within joint limits (N, 14) [rad], read-only.

    If no posture is within them, all postures are returned, moved to the nearest limits.

    Args:
        lower: lower joint limits (14,) [rad].
        upper: upper joint limits (14,) [rad].
    """
    return _within(lower.tobytes(), upper.tobytes())


@lru_cache(maxsize=64)
def _within(low: bytes, high: bytes) -> Floats:
    """See `postures_within`; the limits as their bytes."""
    lower, upper, postures = np.frombuffer(low), np.frombuffer(high), posture_set()
    inside = np.all((postures >= lower) & (postures <= upper), axis=1)
    found = postures[inside] if inside.any() else np.clip(postures, lower, upper)
    found.setflags(write=False)
    return found


def main(count: int = 1000, seed: int = 0) -> None:
    """Sample the posture set again and write it, in degrees with two decimals.

    Args:
        count: number of postures.
        seed: seed of the candidates.
    """
    checker, rng = PostureChecker(), np.random.default_rng(seed)
    rows: list[Floats] = []
    tried = 0
    while len(rows) < count:
        tried += 1
        posture = np.radians(np.round(np.degrees(checker.candidate(rng)), 2))
        if checker.accepts(posture):
            rows.append(np.degrees(posture))
    folder = asset_path("mjcf/kengoro_arm/arm.xml").parents[2] / "postures"
    with whole_file(folder / "kengoro_arm.csv") as path:
        np.savetxt(path, rows, fmt="%.2f", delimiter=",", header=",".join(JOINTS), comments="")
    print(f"{count} postures accepted of {tried} sampled")
    for joint, (low, high) in zip(JOINTS, np.percentile(rows, [5, 95], axis=0).T, strict=True):
        print(f"{joint:12s} {low:7.1f} .. {high:6.1f} deg, span {high - low:5.1f}")


if __name__ == "__main__":
    main()
