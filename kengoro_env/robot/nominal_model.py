"""Nominal model of a robot: names, joint limits, muscle lengths, moment arms and loads."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.errors import ModelError, UnknownNameError
from kengoro_env.robot.model_file import is_muscle, load_spec
from kengoro_env.robot.tendons import actuated_joints
from kengoro_env.types import Floats

SAMPLES = 200
"""Number of postures, uniform between the joint limits, over which lengths are taken."""
ARM = 1e-12
"""Least moment arm of a muscle that crosses a joint [m/rad]."""
DISPLACEMENT = 1e-6
"""Displacement of a point of attachment by which its effect is computed [m]."""
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


class _Point(NamedTuple):
    """A site, and the muscles of which it is a point, with its rank in the path of each."""

    site: int
    uses: list[tuple[int, int]]


class NominalArm:
    """Geometric model of a robot with straight muscles through their points (paper, sec. II-A).

    Args:
        scene: MJCF file with the robot.
        folders: further folders whose files the model may include or load.
        without: names of muscles that are left out.

    Attributes:
        joints: names of the joints, in the order of (n,) arrays.
        muscles: names of the muscles, in the order of (m,) arrays.
        lower: lower joint limits (n,) [rad].
        upper: upper joint limits (n,) [rad].
        crosses: which muscle crosses which joint (m, n).
        model: the compiled model.

    Raises:
        ModelError: the file cannot be used, or has no muscles, or they cross a joint that is
            neither a hinge nor a slide, or one without a range.
    """

    def __init__(
        self,
        scene: Path | str,
        folders: Sequence[Path | str] = (),
        without: Sequence[str] = (),
    ) -> None:
        spec = load_spec(scene, folders)
        muscles = tuple(tendon.name for tendon in spec.tendons if is_muscle(tendon))
        for name in without:
            if name not in muscles:
                raise UnknownNameError("muscle", name, muscles)
        self.muscles = tuple(name for name in muscles if name not in without)
        if not self.muscles:
            raise ModelError(
                f"the model file {scene} has no muscles: a muscle is a <spatial> in <tendon>, "
                "through sites"
            )
        self.model = model = spec.compile()
        self._data = mujoco.MjData(model)
        self._tendon = np.array([model.tendon(muscle).id for muscle in self.muscles])
        self.joints = actuated_joints(model)
        addresses = [model.joint(joint) for joint in self.joints]
        self._position = np.array([joint.qposadr[0] for joint in addresses], dtype=int)
        self._velocity = np.array([joint.dofadr[0] for joint in addresses], dtype=int)
        numbers = [joint.id for joint in addresses]
        self._check_joints(scene, numbers)
        self.lower, self.upper = model.jnt_range[numbers].T.copy()
        self._zero = self._paths(np.zeros(len(self.joints)))
        self.crosses = self._crossings()

    def _check_joints(self, scene: Path | str, numbers: list[int]) -> None:
        """Refuse muscles without a joint, and joints whose angle has no bounds."""
        model = self.model
        for dof in np.flatnonzero(np.abs(self._jacobian(self._data.qpos)).max(axis=0) > ARM):
            joint = model.joint(int(model.dof_jntid[dof]))
            if joint.type[0] not in (HINGE, SLIDE):
                body = model.body(int(model.dof_bodyid[dof])).name
                raise ModelError(
                    f"the model file {scene} has a muscle that crosses the free or ball joint of "
                    f"the body {body!r}; replace it by hinges, or fix the body"
                )
        if not self.joints:
            raise ModelError(f"the model file {scene} has no joint that a muscle crosses")
        for number in numbers:
            if not model.jnt_limited[number]:
                raise ModelError(
                    f"the model file {scene} has no range of the joint "
                    f'{model.joint(number).name!r}, which a muscle crosses; add range="... ..."'
                )

    def _paths(self, posture: Floats) -> Floats:
        self._data.qpos[self._position] = posture
        mujoco.mj_kinematics(self.model, self._data)
        mujoco.mj_comPos(self.model, self._data)
        mujoco.mj_tendon(self.model, self._data)
        return np.asarray(self._data.ten_length[self._tendon])

    def _jacobian(self, positions: Floats) -> Floats:
        """Derivative of the muscles' lengths by all velocities (m, nv) at positions (nq,)."""
        model, data = self.model, self._data
        data.qpos[:] = positions
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        dense = np.zeros((model.ntendon, model.nv))
        mujoco.mju_sparse2dense(
            dense, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
        )
        return dense[self._tendon]

    def _crossings(self) -> NDArray[np.bool_]:
        """Which muscle crosses which joint: its length depends on the joint's angle."""
        rng = np.random.default_rng(0)
        postures = rng.uniform(self.lower, self.upper, (8, len(self.joints)))
        return np.any([np.abs(self.moment_arms(q)) > ARM for q in postures], axis=0)

    def lengths(self, postures: Floats) -> Floats:
        """Muscle lengths (B, m) [m] relative to the zero posture, for postures (B, n) [rad]."""
        return np.array([self._paths(posture) for posture in np.atleast_2d(postures)]) - self._zero

    def point_sensitivities(self, postures: Floats) -> Floats:
        """How the lengths change if points of attachment are displaced (B, m, P) [1].

        The points of a muscle are the sites of its path, in their order; each is displaced along
        the three axes of its body. Muscles with fewer points than others have zeros at the end.

        Args:
            postures: (B, n) [rad].
        """
        points = self._points
        most = max(len(own) for own in points)
        found = np.zeros((len(postures), len(points), most, 3))
        for posture, change in zip(postures, found, strict=True):
            base = self._paths(posture).copy()
            for batch in self._batches:
                self._displace(batch, base, change)
        return found.reshape(len(postures), len(points), 3 * most)

    def _displace(self, batch: list[_Point], base: Floats, change: Floats) -> None:
        """Add what some sites do to lengths (m,) [m], to the change (m, points, 3) [1]."""
        data, sites = self._data, [point.site for point in batch]
        before = data.site_xpos[sites].copy()
        turned = data.xmat[self.model.site_bodyid[sites]].reshape(-1, 3, 3)
        for axis in range(3):
            data.site_xpos[sites] = before + DISPLACEMENT * turned[:, :, axis]
            mujoco.mj_tendon(self.model, data)
            slope = (data.ten_length[self._tendon] - base) / DISPLACEMENT
            for point in batch:
                for muscle, rank in point.uses:
                    change[muscle, rank, axis] = slope[muscle]
        data.site_xpos[sites] = before

    @cached_property
    def _points(self) -> list[list[int]]:
        """Sites of each muscle's path, in their order, each once."""
        model, site = self.model, mujoco.mjtWrap.mjWRAP_SITE
        found = []
        for number in self._tendon:
            begin = model.tendon_adr[number]
            path = range(begin, begin + model.tendon_num[number])
            sites = (int(model.wrap_objid[k]) for k in path if model.wrap_type[k] == site)
            found.append(list(dict.fromkeys(sites)))
        return found

    @cached_property
    def _batches(self) -> list[list[_Point]]:
        """Points that can be displaced at once, because no muscle has two of them."""
        uses: dict[int, list[tuple[int, int]]] = {}
        for muscle, sites in enumerate(self._points):
            for rank, site in enumerate(sites):
                uses.setdefault(site, []).append((muscle, rank))
        batches: list[list[_Point]] = []
        taken: list[set[int]] = []
        for site, own in uses.items():
            muscles = {muscle for muscle, _ in own}
            free = (k for k, others in enumerate(taken) if not others & muscles)
            number = next(free, len(taken))
            if number == len(taken):
                taken.append(set())
                batches.append([])
            taken[number] |= muscles
            batches[number].append(_Point(site, own))
        return batches

    @cached_property
    def travel(self) -> float:
        """How far the muscles move between the joint limits [m].

        The median over muscles of the standard deviation of the length over `SAMPLES` postures.
        """
        rng = np.random.default_rng(0)
        postures = rng.uniform(self.lower, self.upper, (SAMPLES, len(self.joints)))
        return float(np.median(self.lengths(postures).std(axis=0)))

    def moment_arms(self, posture: Floats) -> Floats:
        """Moment arms dl/dq (m, n) [m/rad] at a posture (n,) [rad]."""
        self._data.qpos[self._position] = posture
        return self._jacobian(self._data.qpos.copy())[:, self._velocity]

    @property
    def acceleration(self) -> Floats:
        """Acceleration of gravity in the world's axes (3,) [m/s^2]."""
        return np.array(self.model.opt.gravity)

    def gravity(self, posture: Floats) -> Floats:
        """Torques of gravity on the joints (n,) [N m] at a posture (n,) [rad].

        Torques of springs in joints and tendons are included.
        """
        self._data.qpos[self._position] = posture
        self._data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self._data)
        data, joints = self._data, self._velocity
        return np.asarray(data.qfrc_spring[joints] - data.qfrc_bias[joints])

    def inertia(self, posture: Floats) -> Floats:
        """Inertia of each joint alone (n,) [kg m^2] at a posture (n,) [rad]."""
        self._data.qpos[self._position] = posture
        mujoco.mj_forward(self.model, self._data)
        matrix = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self._data, matrix)
        return np.diag(matrix)[self._velocity]

    def joint_friction(self) -> tuple[Floats, Floats]:
        """Viscous (n,) [N m s/rad] and dry friction (n,) [N m] of the joints."""
        model, joints = self.model, self._velocity
        damping = np.asarray(model.dof_damping)
        return damping.reshape(model.nv, -1)[joints, 0], model.dof_frictionloss[joints].copy()
