"""Departures of the muscles' geometry: attachment points, and bones that tendons wrap over."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from kengoro_env.robot.draft import Draft


@dataclass(frozen=True)
class AttachmentDisplacement:
    """Start, relay and end points are displaced from the nominal model.

    Attributes:
        sigma: standard deviation of the displacement along each axis [m], clipped at two
            sigma.
        seed: seed of the displacements.
    """

    sigma: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Move every site of every tendon."""
        if self.sigma == 0.0:
            return
        rng = np.random.default_rng([self.seed, 101])
        for tendon in draft.spec.tendons:
            for element in tendon.path:
                if element.type == mujoco.mjtWrap.mjWRAP_SITE:
                    shift = self.sigma * np.clip(rng.standard_normal(3), -2.0, 2.0)
                    element.target.pos = element.target.pos + shift


@dataclass(frozen=True)
class Bone:
    """A bone that tendons wrap over: a sphere or a cylinder, fixed to a body.

    Attributes:
        body: name of the body.
        position: centre in the body's frame [m].
        radius: radius at the scale 1 [m].
        axis: direction of the cylinder in the body's frame; None: a sphere.
        tendons: muscle, segment of its path, and direction from the bone's centre to the side on
            which the tendon passes, in the body's frame.
    """

    body: str
    position: tuple[float, float, float]
    radius: float
    axis: tuple[float, float, float] | None
    tendons: tuple[tuple[str, int, tuple[float, float, float]], ...]


BONES: dict[str, Bone] = {
    "humeral_head": Bone(
        "humerus",
        (-0.003, 0.002, 0.005),
        0.0228,
        None,
        (
            ("infraspin", 0, (-1.0, -1.0, 0.0)),
            ("subscap", 0, (1.0, 0.6, 0.0)),
            ("delt_post", 1, (-0.4, -1.0, 0.0)),
        ),
    ),
    "trochlea": Bone(
        "ulna",
        (0.0, 0.0, 0.0),
        0.016,
        (0.0, 1.0, 0.0),
        (("triceps", 1, (-1.0, 0.0, 0.0)), ("biceps", 1, (1.0, 0.0, 0.0))),
    ),
    "rib_cage": Bone(
        "thorax",
        (-0.022, -0.070, -0.147),
        0.074,
        (0.0, 0.0, 1.0),
        (("serr_inf", 0, (-0.4, -1.0, 0.0)), ("serr_sup", 0, (-0.4, -1.0, 0.0))),
    ),
}
"""Humeral head and rib cage after Seth et al. 2019, scaled; the trochlea is a design choice."""


@dataclass(frozen=True)
class BoneWrapping:
    """Tendons wrap over bones that they pass straight through in the nominal model.

    Attributes:
        scale: radius of the bones relative to `BONES` [1].
    """

    scale: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Add the bones, and wrap the tendons over them."""
        if self.scale == 0.0:
            return
        for name, bone in BONES.items():
            body = draft.spec.body(bone.body)
            tendons = [tendon for tendon in bone.tendons if tendon[0] in draft.tendons]
            if not tendons:  # the scene has only a part of the arm
                continue
            radius = self.scale * bone.radius
            geom = body.add_geom(
                name=f"wrap_{name}",
                type=mujoco.mjtGeom.mjGEOM_SPHERE
                if bone.axis is None
                else mujoco.mjtGeom.mjGEOM_CYLINDER,
                size=np.array([radius, 0.1, 0.0]),
                pos=np.array(bone.position),
                contype=0,
                conaffinity=0,
                mass=0.0,
                group=4,
            )
            if bone.axis is not None:
                geom.alt.zaxis = np.array(bone.axis)
            for muscle, segment, side in tendons:
                direction = np.array(side) / np.linalg.norm(side)
                site = body.add_site(
                    name=f"side_{name}_{muscle}",
                    pos=np.array(bone.position) + 1.5 * bone.radius * direction,
                    group=4,
                )
                draft.tendon(muscle).wraps[segment] = (geom.name, site.name)
