"""A cart on a rail that a tendon is tied to, for tests of friction."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from reality_gap.causes.base import Location
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.system import System, compile_system
from reality_gap.types import Floats

CART = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <site name="post" pos="-1 0 0"/>
    <body name="cart">
      <joint name="rail" type="slide" axis="1 0 0" frictionloss="0.5" damping="{damping}"/>
      <geom type="sphere" size="0.05" mass="{mass}"/>
      <site name="hook"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="tendon"><site site="post"/><site site="hook"/></spatial>
    <spatial name="rope"><site site="post"/><site site="hook"/></spatial>
  </tendon>
  <actuator><motor name="motor" joint="rail"/></actuator>
  <sensor>
    <jointpos name="position" joint="rail"/>
    <tendonactuatorfrc name="sum_on_tendon" tendon="tendon"/>
    <jointactuatorfrc name="sum_on_rail" joint="rail"/>
  </sensor>
</mujoco>
"""
MASS, DAMPING = 10.0, 100.0
BEND = 1e-3
ON_TENDON, ON_RAIL = Location("tendon", ("tendon",)), Location("joint", ("rail",))

Kind = Literal["sensor", "effort"]


def cart_system(
    folder: Path,
    *sensors: str,
    kind: Kind = "sensor",
    mass: float = MASS,
    damping: float = DAMPING,
) -> System:
    """Return a cart with measured ``sensors``, or with efforts of joints."""
    path = folder / "cart.xml"
    path.write_text(CART.format(mass=mass, damping=damping))
    time = np.array([0.0, 1.0])
    channels = [Channel("position", "position")]
    channels += [Channel(sensor, sensor, kind=kind) for sensor in sensors]
    readings = tuple(Reading(time, np.zeros(2)) for _ in channels)
    episode = Episode("still", time, np.zeros((2, 1)), readings)
    return compile_system(Study("cart", path, tuple(channels), (episode,)))


def ramp(*corners: float, steps: int = 8000) -> Floats:
    """Return loads that change so slowly that the bristles are always at rest."""
    ends = np.arange(len(corners)) * steps
    return np.interp(np.arange(ends[-1]), ends, corners)
