"""Machines for tests of causes: an elbow with three tendons, an arm, a hand, and a screw."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause, Record
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import replay
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import System
from reality_gap.types import Floats

TENDONS = ("biceps", "brachialis", "triceps")

SERVO = (
    '<general name="{0}" tendon="{0}" gainprm="20000" biastype="affine" biasprm="-20 -20000 0" '
    'forcelimited="true" forcerange="-400 -20"/>'
)

ELBOW = f"""
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><joint armature="0.005" damping="0.3"/><site size="0.003"/></default>
  <worldbody>
    <camera name="eye" pos="1.2 0 0" xyaxes="0 1 0 0 0 1"/>
    <body name="upper_arm">
      <geom name="humerus" type="capsule" size="0.02" fromto="0 0 0 0 0 -0.26" contype="0"
            conaffinity="0"/>
      <site name="biceps_0" pos="0.03 0 -0.02"/><site name="biceps_1" pos="0.05 0.01 -0.2"/>
      <site name="brachialis_0" pos="0.025 0 -0.12"/>
      <site name="triceps_0" pos="-0.03 0 -0.05"/><site name="triceps_side" pos="-0.06 0 -0.28"/>
      <body name="forearm" pos="0 0 -0.28">
        <joint name="elbow" axis="0 -1 0" range="0 130" limited="true"/>
        <geom name="trochlea" type="cylinder" size="0.022 0.02" zaxis="0 1 0" contype="0"
              conaffinity="0"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.25" mass="1.4" contype="0"
              conaffinity="0"/>
        <site name="biceps_2" pos="0.025 0 -0.05"/><site name="brachialis_1" pos="0.02 0 -0.04"/>
        <site name="triceps_1" pos="-0.025 0 -0.05"/><site name="marker" pos="0 0.03 -0.25"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="biceps" damping="150"><site site="biceps_0"/><site site="biceps_1"/>
      <site site="biceps_2"/></spatial>
    <spatial name="brachialis" damping="150"><site site="brachialis_0"/><site
      site="brachialis_1"/></spatial>
    <spatial name="triceps" damping="150"><site site="triceps_0"/><geom geom="trochlea"
      sidesite="triceps_side"/><site site="triceps_1"/></spatial>
  </tendon>
  <actuator>{"".join(SERVO.format(name) for name in TENDONS)}</actuator>
  <sensor>
    {"".join(f'<tendonpos name="length_{name}" tendon="{name}"/>' for name in TENDONS)}
    {"".join(f'<actuatorfrc name="tension_{name}" actuator="{name}"/>' for name in TENDONS)}
    <framepos name="marker_position" objtype="site" objname="marker" reftype="camera"
              refname="eye"/>
    <camprojection name="pixel" camera="eye" site="marker"/>
  </sensor>
</mujoco>
"""

SCREW = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body name="carriage">
      <joint name="screw" type="slide" axis="1 0 0" damping="200"/>
      <geom type="box" size="0.1 0.1 0.1" mass="90"/>
      <site name="mark"/>
    </body>
  </worldbody>
  <actuator>
    <general name="motor" joint="screw" gainprm="50000" biastype="affine"
             biasprm="0 -50000 -3000"/>
  </actuator>
  <sensor>
    <jointpos name="position" joint="screw"/>
    <actuatorfrc name="force" actuator="motor"/>
    <framepos name="scale" objtype="site" objname="mark"/>
  </sensor>
</mujoco>
"""

ARM = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><joint armature="0.01" damping="0.4" frictionloss="0.1" stiffness="0.5"/></default>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" range="-90 90" limited="true"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.3 0 0" mass="1.5"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" range="-90 90" limited="true"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0.25 0 0" mass="0.6"/>
        <site name="grip" pos="0.25 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="60" kv="2" forcerange="-8 8"/>
    <position name="elbow" joint="elbow" kp="30" kv="1" forcerange="-2 2"/>
  </actuator>
  <sensor>
    <jointpos name="position_shoulder" joint="shoulder"/>
    <jointpos name="position_elbow" joint="elbow"/>
    <jointvel name="velocity_elbow" joint="elbow"/>
    <actuatorfrc name="force_shoulder" actuator="shoulder"/>
    <actuatorfrc name="force_elbow" actuator="elbow"/>
  </sensor>
</mujoco>
"""

HAND = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><joint type="hinge" axis="0 1 0" armature="0.002" damping="0.05"/></default>
  <worldbody>
    <body name="proximal">
      <joint name="proximal" range="-90 90" limited="true"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.1 0 0" mass="0.2"/>
      <body name="middle" pos="0.1 0 0">
        <joint name="middle"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0.08 0 0" mass="0.1"/>
        <body name="distal" pos="0.08 0 0">
          <joint name="distal"/>
          <geom type="capsule" size="0.02" fromto="0 0 0 0.06 0 0" mass="0.05"/>
        </body>
      </body>
    </body>
    <body name="thumb" pos="0 0.1 0">
      <joint name="thumb" range="-90 90" limited="true"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.1 0 0" mass="0.2"/>
      <body name="tip" pos="0.1 0 0">
        <joint name="tip" stiffness="0.3"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0.08 0 0" mass="0.1"/>
      </body>
    </body>
    <body name="little" pos="0 -0.1 0">
      <joint name="knuckle"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.1 0 0" mass="0.2"/>
      <body name="end" pos="0.1 0 0">
        <joint name="end" stiffness="0.3"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0.08 0 0" mass="0.1"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="both"><joint joint="knuckle" coef="1"/><joint joint="end" coef="0.5"/></fixed>
  </tendon>
  <equality>
    <joint joint1="distal" joint2="middle" polycoef="0 0.8 0 0 0"/>
  </equality>
  <actuator>
    <position name="proximal" joint="proximal" kp="8" kv="0.4" forcerange="-2 2"/>
    <position name="middle" joint="middle" kp="4" kv="0.2" forcerange="-1 1"/>
    <position name="thumb" joint="thumb" kp="8" kv="0.4" forcerange="-2 2"/>
    <position name="little" tendon="both" kp="8" kv="0.4" forcerange="-2 2"/>
  </actuator>
  <sensor>
    <jointpos name="position_proximal" joint="proximal"/>
    <jointpos name="position_middle" joint="middle"/>
    <jointpos name="position_distal" joint="distal"/>
    <jointpos name="position_thumb" joint="thumb"/>
    <jointpos name="position_tip" joint="tip"/>
    <jointpos name="position_knuckle" joint="knuckle"/>
    <jointpos name="position_end" joint="end"/>
  </sensor>
</mujoco>
"""


def hand_study(folder: Path, duration: float = 1.5, model: str = HAND) -> Study:
    """A log of a hand: two fingers with coupled joints, and a thumb whose tip swings freely."""
    waves = ((0.0, 0.5, 5.0), (0.0, 0.6, 8.0), (0.0, 0.6, 6.0), (0.0, 0.5, 4.0))
    found = _swing(folder / "hand.xml", model, duration, *waves)
    return replace(found, channels=tuple(replace(c, noise=1e-3) for c in found.channels))


def arm_study(folder: Path, duration: float = 1.5, model: str = ARM) -> Study:
    """A log of two position servos that swing a heavy arm, one of them up to its limit."""
    return _swing(folder / "arm.xml", model, duration, (0.0, 0.8, 5.0), (0.3, 0.9, 8.0))


def _swing(path: Path, model: str, duration: float, *waves: tuple[float, float, float]) -> Study:
    """A log of a model whose commands are sines, each with a mean, an amplitude and a rate."""
    path.write_text(model)
    channels = sensed(mujoco.MjModel.from_xml_path(str(path)))
    time = np.arange(0.0, duration, 0.02)
    command = np.stack([mean + size * np.sin(rate * time) for mean, size, rate in waves], axis=1)
    episode = Episode("swing", time, command, silent(channels, duration))
    return Study(path.stem, path, channels, (episode,), Initial(settle=0.3))


def elbow_study(folder: Path, duration: float = 1.5) -> Study:
    """Two logs of an elbow that swings, with tensions between their limits."""
    path = folder / "elbow.xml"
    path.write_text(ELBOW)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    episodes, channels = [], sensed(model)
    for phase in (0.0, 2.0):
        time = np.arange(0.0, duration, 0.02)
        command = np.empty((len(time), 3))
        for i, angle in enumerate(1.0 + 0.6 * np.sin(4.0 * time + phase)):
            data.qpos[0] = angle
            mujoco.mj_kinematics(model, data)
            mujoco.mj_tendon(model, data)
            command[i] = data.ten_length - np.array([2.0, 1.0, 1.0 + np.sin(9 * time[i])]) * 1e-3
        episodes.append(Episode("swing", time, command, silent(channels, duration)))
    return Study("elbow", path, channels, tuple(episodes), Initial({"elbow": 1.0}, settle=0.4))


def screw_study(folder: Path, effort: bool = False) -> Study:
    """A log of a carriage that goes to and fro; of its effort instead of its commands, if asked."""
    path = folder / "screw.xml"
    path.write_text(SCREW)
    model = mujoco.MjModel.from_xml_path(str(path))
    time = np.arange(0.0, 2.0, 0.02)
    position = 0.1 * np.sin(4.0 * time)
    channels = sensed(model)
    if not effort:
        episode = Episode("to and fro", time, position[:, None], silent(channels, 2.0))
        return Study("screw", path, channels, (episode,))
    channels = (
        Channel("position", "position", unit="m"),
        Channel("effort", "screw", unit="N", noise=1.0, kind="effort"),
    )
    readings = (Reading(time, position), Reading(time, 100.0 * np.cos(4.0 * time)))
    episode = Episode("to and fro", time, np.zeros((len(time), 1)), readings)
    return Study("screw", path, channels, (episode,))


def pushed_screw(folder: Path, begin: float, end: float) -> Study:
    """A log of 12 s of a carriage's effort, with a push of 40 N between two times [s]."""
    study = screw_study(folder, effort=True)
    time = np.arange(0.0, 12.0, 0.01)
    rng = np.random.default_rng(3)
    rates, phases = np.array([6.1, 11.7, 17.3]), rng.uniform(0.0, 6.0, 3)
    angle = rates * time[:, None] + phases
    position = 0.02 * np.sin(angle).sum(axis=1)
    speed = 0.02 * (np.cos(angle) @ rates)
    acceleration = -0.02 * (np.sin(angle) @ rates**2)
    push = 40.0 * ((time >= begin) & (time < end))
    effort = 90.0 * acceleration + 200.0 * speed - push + rng.standard_normal(len(time))
    readings = (
        Reading(time, position + 1e-6 * rng.standard_normal(len(time))),
        Reading(time, effort),
    )
    channels = (replace(study.channels[0], noise=1e-6), study.channels[1])
    command = np.zeros((len(time), 1))
    episode = replace(study.episodes[0], time=time, command=command, readings=readings)
    return replace(study, channels=channels, episodes=(episode,))


def sensed(model: mujoco.MjModel) -> tuple[Channel, ...]:
    """A channel for every component of every sensor, with its noise."""
    noise = {"t": 1.0, "f": 1.0, "p": 0.5}
    return tuple(
        Channel(
            f"{model.sensor(s).name}_{i}",
            model.sensor(s).name,
            i,
            noise=noise.get(model.sensor(s).name[:1], 1e-4),
        )
        for s in range(model.nsensor)
        for i in range(int(model.sensor(s).dim[0]))
    )


def silent(channels: tuple[Channel, ...], duration: float) -> tuple[Reading, ...]:
    """Readings whose values do not matter."""
    time = np.arange(0.0, duration, 0.01)
    return tuple(Reading(time, np.zeros(len(time))) for _ in channels)


def first_of_each_kind(system: System, mechanism: Cause) -> list[Candidate]:
    """One candidate for each kind of location and note, alone and in a group."""
    found: dict[tuple[str, str, bool], Candidate] = {}
    for location in mechanism.locations(system):
        key = (location.kind, location.note, len(location.elements) > 1)
        found.setdefault(
            key, Candidate(mechanism, location, mechanism.parameters(system, location))
        )
    return list(found.values())


def candidates_of(system: System, id: str) -> list[Candidate]:
    return first_of_each_kind(system, CATALOGUE[id])


def towards_null(candidate: Candidate, share: float) -> dict[str, float]:
    """A share of each parameter's scale; a parameter with starts is at one of them."""
    held = [p for p in candidate.parameters if p.hints.starts]
    values = {p.name: p.null + share * p.scale for p in candidate.parameters}
    if len(held) < len(candidate.parameters):
        values |= {p.name: p.hints.starts[len(p.hints.starts) // 2] for p in held}
    return values


def predict(system: System, *parts: tuple[Candidate, dict[str, float]]) -> Floats:
    """The replay in units of the noise."""
    readings = measured(system.study)
    return replay(build(system, list(parts)), system.study, readings).prediction / readings.noise


def records(system: System, *parts: tuple[Candidate, dict[str, float]]) -> tuple[Record, ...]:
    """Records of the physics steps of a replay."""
    study = system.study
    return replay(build(system, list(parts)), study, measured(study)).records
