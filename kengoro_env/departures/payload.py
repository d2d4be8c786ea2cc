"""A load in the hand, or anywhere else on the robot."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from kengoro_env.errors import ArgumentError, UnknownNameError
from kengoro_env.robot.draft import Draft

RADIUS = 0.01
"""Radius of the ball [m]."""


@dataclass(frozen=True)
class Payload:
    """A ball that the nominal model lacks; it collides with nothing.

    Attributes:
        mass: of the ball [kg].
        site: where it is; the hand's grip if left out.

    Raises:
        ArgumentError: the mass is negative or not finite.
    """

    mass: float = 0.0
    site: str = "grip"

    def __post_init__(self) -> None:
        if not 0.0 <= self.mass < np.inf:
            raise ArgumentError(
                f"Payload: mass is {self.mass} kg, but must be finite and at least 0"
            )

    def edit(self, draft: Draft) -> None:
        """Add the ball to the body of the site.

        Raises:
            UnknownNameError: there is no such site.
        """
        if self.mass == 0.0:
            return
        sites = {site.name: (body, site) for body in draft.spec.bodies for site in body.sites}
        if self.site not in sites:
            raise UnknownNameError("site", self.site, sorted(name for name in sites if name))
        body, site = sites[self.site]
        ball, kind = body.add_body(pos=site.pos), mujoco.mjtGeom.mjGEOM_SPHERE
        size = [RADIUS, 0.0, 0.0]
        ball.add_geom(type=kind, size=size, mass=self.mass, contype=0, conaffinity=0)
