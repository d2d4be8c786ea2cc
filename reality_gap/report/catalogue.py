"""Catalogue: descriptions of all causes, with their parameters and units.

The locations and the parameters of a cause depend on the model. They are those of a small reference
model here: a hinge joint that two tendons with length servos move, another with a position servo,
two that nothing drives, of which one follows the other, a camera and a marker.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import mujoco
import numpy as np

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.system import System, compile_system

REFERENCE = """
<mujoco>
  <worldbody>
    <camera name="eye" pos="0 -1 0"/>
    <site name="origin_front" pos="0.03 0 0.2"/>
    <site name="origin_back" pos="-0.03 0 0.2"/>
    <body name="link">
      <joint name="joint" axis="0 -1 0" range="-20 20" limited="true"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="1"/>
      <site name="insertion_front" pos="0.03 0 -0.1"/>
      <site name="insertion_back" pos="-0.03 0 -0.1"/>
      <site name="marker" pos="0 0 -0.3"/>
      <body name="end" pos="0 0 -0.3">
        <joint name="wrist" axis="0 -1 0" range="-20 20" limited="true"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.1" mass="0.2"/>
        <body name="finger" pos="0 0 -0.1">
          <joint name="finger" axis="0 -1 0"/>
          <geom size="0.02" pos="0 0 -0.05" mass="0.1"/>
          <body name="tip" pos="0 0 -0.1">
            <joint name="tip" axis="0 -1 0"/>
            <geom size="0.02" pos="0 0 -0.05" mass="0.1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="front"><site site="origin_front"/><site site="insertion_front"/></spatial>
    <spatial name="back"><site site="origin_back"/><site site="insertion_back"/></spatial>
  </tendon>
  <equality><joint joint1="tip" joint2="finger" polycoef="0 0.5 0 0 0"/></equality>
  <actuator>
    <general name="front" tendon="front" gainprm="5000" biastype="affine" biasprm="0 -5000 0"/>
    <general name="back" tendon="back" gainprm="5000" biastype="affine" biasprm="0 -5000 0"/>
    <position name="wrist" joint="wrist" kp="20" kv="1" forcerange="-5 5"/>
  </actuator>
  <sensor>
    <tendonpos name="length_front" tendon="front"/>
    <tendonpos name="length_back" tendon="back"/>
    <actuatorfrc name="tension_front" actuator="front"/>
    <actuatorfrc name="tension_back" actuator="back"/>
    <jointpos name="angle" joint="joint"/>
    <jointpos name="angle_wrist" joint="wrist"/>
    <actuatorfrc name="torque_wrist" actuator="wrist"/>
    <framepos name="position" objtype="site" objname="marker" reftype="camera" refname="eye"/>
    <framequat name="orientation" objtype="site" objname="marker" reftype="camera" refname="eye"/>
  </sensor>
</mujoco>
"""


def describe_catalogue() -> list[str]:
    """Return lines of text: for each cause its id, its explanation and its parameters."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "reference.xml"
        path.write_text(REFERENCE, encoding="utf-8")
        system = _reference_system(path)
        return [line for cause in CATALOGUE.values() for line in _describe(cause, system)]


def _describe(cause: Cause, system: System) -> list[str]:
    """Return the lines of a cause, with one line for each different list of parameters."""
    kinds: dict[str, list[str]] = {}
    for location in cause.locations(system):
        if len(location.elements) == 1 or location.kind == "sensor":
            parameters = cause.parameters(system, location)
            text = ", ".join(f"{p.name} [{p.unit}]" for p in parameters)
            known = kinds.setdefault(text, [])
            if location.kind not in known:
                known.append(location.kind)
    lines = [f"  {' or '.join(known)}: {text}" for text, known in kinds.items()]
    return [f"{cause.id}: {cause.explanation}", *lines]


def _reference_system(path: Path) -> System:
    """Return the reference model as a system all of whose sensors are measured, at rest."""
    model = mujoco.MjModel.from_xml_path(str(path))
    time = np.array([0.0, 1.0])
    channels = tuple(
        Channel(f"{model.sensor(s).name}_{i}", model.sensor(s).name, i)
        for s in range(model.nsensor)
        for i in range(int(model.sensor(s).dim[0]))
    )
    readings = tuple(Reading(time, np.zeros(2)) for _ in channels)
    episode = Episode("rest", time, np.zeros((2, model.nu)), readings)
    return compile_system(Study("reference", path, channels, (episode,)))
