"""MJCF models of the robots: four small ones as text, and Kengoro's arm at twice its size."""

from __future__ import annotations

from pathlib import Path

import mujoco

from kengoro.robots import arm_scene
from kengoro_env.assets import asset_path
from kengoro_env.robot.model_file import load_spec
from mjcf_sandbox.files import write_text

MARKER = asset_path("mjcf/kengoro_arm/textures/marker_hand.png")

HEAD = f"""
  <compiler angle="degree" autolimits="true"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><geom contype="0" conaffinity="0"/><site size="0.002"/></default>
  <asset>
    <texture name="marker" type="2d" file="{MARKER}"/>
    <material name="marker" texture="marker"/>
  </asset>"""

FINGER = f"""<mujoco model="planar finger">{HEAD}
  <worldbody>
    <light pos="0 -0.3 0.5"/>
    <camera name="eye" pos="0.05 -0.16 -0.02" xyaxes="1 0 0 0 0 1" fovy="45"/>
    <site name="mcp_flex_0" pos="-0.008 0 -0.010"/>
    <site name="mcp_extend_0" pos="-0.008 0 0.010"/>
    <body name="proximal">
      <joint name="mcp" axis="0 1 0" range="-20 60" damping="0.002"/>
      <geom type="capsule" fromto="0 0 0 0.06 0 0" size="0.006" mass="0.03"/>
      <site name="mcp_flex_1" pos="0.008 0 -0.010"/>
      <site name="mcp_extend_1" pos="0.008 0 0.010"/>
      <site name="pip_flex_0" pos="0.052 0 -0.008"/>
      <site name="pip_extend_0" pos="0.052 0 0.008"/>
      <body name="distal" pos="0.06 0 0">
        <joint name="pip" axis="0 1 0" range="0 60" damping="0.002"/>
        <geom type="capsule" fromto="0 0 0 0.04 0 0" size="0.005" mass="0.015"/>
        <geom type="box" pos="0.025 -0.007 0" size="0.008 0.008 0.0005" euler="90 0 0" mass="0.001"
              material="marker"/>
        <site name="marker_hand" pos="0.025 -0.0075 0" euler="90 0 0"/>
        <site name="pip_flex_1" pos="0.008 0 -0.008"/>
        <site name="pip_extend_1" pos="0.008 0 0.008"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="mcp_flex"><site site="mcp_flex_0"/><site site="mcp_flex_1"/></spatial>
    <spatial name="mcp_extend"><site site="mcp_extend_0"/><site site="mcp_extend_1"/></spatial>
    <spatial name="pip_flex"><site site="pip_flex_0"/><site site="pip_flex_1"/></spatial>
    <spatial name="pip_extend"><site site="pip_extend_0"/><site site="pip_extend_1"/></spatial>
  </tendon>
  <actuator>
    <general name="mcp_flex" tendon="mcp_flex" forcerange="-60 0"/>
    <general name="mcp_extend" tendon="mcp_extend" forcerange="-60 0"/>
    <general name="pip_flex" tendon="pip_flex" forcerange="-60 0"/>
    <general name="pip_extend" tendon="pip_extend" forcerange="-60 0"/>
  </actuator>
</mujoco>"""
"""Two joints and four wires, links of 60 and 40 mm, motors of 60 N."""

PULLEY_FINGER = f"""<mujoco model="finger with pulleys">{HEAD}
  <worldbody>
    <light pos="0.1 -0.2 0.6"/>
    <camera name="eye" pos="0.39 0 0.06" xyaxes="0 1 0 -0.5 0 0.866" fovy="45"/>
    <site name="base_top" pos="-0.02 0 0.022"/>
    <site name="base_left" pos="-0.02 0.02 -0.005"/>
    <site name="base_right" pos="-0.02 -0.02 -0.005"/>
    <site name="base_mid" pos="-0.02 0 -0.007"/>
    <site name="base_low" pos="-0.02 0 -0.020"/>
    <body name="proximal">
      <joint name="spread" axis="0 0 1" range="-20 20" damping="0.02" armature="1e-4"/>
      <joint name="mcp" axis="0 1 0" range="-20 50" damping="0.02" armature="1e-4"/>
      <geom type="capsule" fromto="0 0 0 0.08 0 0" size="0.012" mass="0.08"/>
      <geom name="mcp_pin" type="cylinder" fromto="0 0.012 0 0 -0.012 0" size="0.016" mass="0.005"/>
      <site name="mcp_top" pos="0 0 0.024"/>
      <site name="mcp_low" pos="0 0 -0.024"/>
      <site name="prox_top" pos="0.030 0 0.018"/>
      <site name="prox_left" pos="0.02 0.02 -0.005"/>
      <site name="prox_right" pos="0.02 -0.02 -0.005"/>
      <site name="prox_mid" pos="0.030 0 -0.007"/>
      <site name="prox_mid_2" pos="0.060 0 -0.020"/>
      <site name="prox_low" pos="0.030 0 -0.018"/>
      <site name="prox_low_2" pos="0.062 0 -0.009"/>
      <body name="middle" pos="0.08 0 0">
        <joint name="pip" axis="0 1 0" range="0 55" damping="0.02" armature="1e-4"/>
        <geom type="capsule" fromto="0 0 0 0.06 0 0" size="0.010" mass="0.05"/>
        <geom name="pip_pin" type="cylinder" fromto="0 0.005 0 0 -0.005 0" size="0.012"
              mass="0.003"/>
        <site name="pip_side" pos="0 0 0.020"/>
        <site name="mid_top" pos="0.02 0 0.013"/>
        <site name="mid_top_2" pos="0.03 0 0.014"/>
        <site name="mid_mid" pos="0.02 0 -0.020"/>
        <site name="mid_low" pos="0.018 0 -0.009"/>
        <site name="mid_low_2" pos="0.045 0 -0.014"/>
        <body name="distal" pos="0.06 0 0">
          <joint name="dip" axis="0 1 0" range="0 45" damping="0.02" armature="1e-4"/>
          <geom type="capsule" fromto="0 0 0 0.04 0 0" size="0.008" mass="0.03"/>
          <geom name="dip_pin" type="cylinder" fromto="0 0.005 0 0 -0.005 0" size="0.010"
                mass="0.002"/>
          <geom type="box" pos="0.025 0 0.014" size="0.015 0.015 0.0005" mass="0.003"
                material="marker"/>
          <site name="marker_hand" pos="0.025 0 0.0145"/>
          <site name="dip_side" pos="0 0 0.018"/>
          <site name="dist_top" pos="0.016 0 0.009"/>
          <site name="dist_low" pos="0.022 0 -0.010"/>
        </body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="extensor">
      <site site="base_top"/><geom geom="mcp_pin" sidesite="mcp_top"/><site site="prox_top"/>
      <pulley divisor="2"/>
      <site site="prox_top"/><geom geom="pip_pin" sidesite="pip_side"/><site site="mid_top"/>
      <pulley divisor="2"/>
      <site site="prox_top"/><geom geom="pip_pin" sidesite="pip_side"/><site site="mid_top_2"/>
      <geom geom="dip_pin" sidesite="dip_side"/><site site="dist_top"/>
    </spatial>
    <spatial name="middle_flexor">
      <site site="base_mid"/><site site="prox_mid"/><site site="prox_mid_2"/><site site="mid_mid"/>
    </spatial>
    <spatial name="deep_flexor">
      <site site="base_low"/><geom geom="mcp_pin" sidesite="mcp_low"/><site site="prox_low"/>
      <site site="prox_low_2"/><site site="mid_low"/><site site="mid_low_2"/>
      <site site="dist_low"/>
    </spatial>
    <spatial name="left"><site site="base_left"/><site site="prox_left"/></spatial>
    <spatial name="right"><site site="base_right"/><site site="prox_right"/></spatial>
  </tendon>
</mujoco>"""
"""Four joints and five tendons that wrap over pins and split by pulleys, as in a human finger."""

NECK = f"""<mujoco model="neck">{HEAD}
  <worldbody>
    <light pos="0.5 0 1"/>
    <camera name="eye" pos="0.75 0 0.22" xyaxes="0 1 0 0 0 1" fovy="45"/>
    <site name="front_0" pos="0.06 0 0"/>
    <site name="left_0" pos="-0.03 0.052 0"/>
    <site name="right_0" pos="-0.03 -0.052 0"/>
    <body name="skull" pos="0 0 0.08">
      <joint name="pitch" axis="0 1 0" range="-25 25" damping="0.1"/>
      <joint name="roll" axis="1 0 0" range="-25 25" damping="0.1"/>
      <geom type="sphere" pos="0 0 0.12" size="0.08" mass="1.5"/>
      <geom type="box" pos="0.09 0 0.12" size="0.03 0.03 0.001" euler="0 90 0" mass="0.01"
            material="marker"/>
      <site name="marker_hand" pos="0.092 0 0.12" euler="0 90 0"/>
      <site name="front_1" pos="0.06 0 0.05"/>
      <site name="left_1" pos="-0.03 0.052 0.05"/>
      <site name="right_1" pos="-0.03 -0.052 0.05"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="front"><site site="front_0"/><site site="front_1"/></spatial>
    <spatial name="left"><site site="left_0"/><site site="left_1"/></spatial>
    <spatial name="right"><site site="right_0"/><site site="right_1"/></spatial>
  </tendon>
</mujoco>"""
"""Two joints and three wires, which can pull only."""

DOCS_ARM = Path(__file__).resolve().parents[2] / "examples" / "arm3.xml"
"""The arm of `docs/own_robot.md`."""

SIDES = {
    "planar-finger": 0.016 * 5 / 6,
    "docs-arm": 0.05,
    "pulley-finger": 0.03 * 5 / 6,
    "neck": 0.05,
    "double-arm": 0.1,
}
"""Side of the hand's marker of each robot [m]: five sixths of its plate."""

ROBOTS = tuple(SIDES)


def write_model(name: str, folder: Path) -> Path:
    """Write the model of a robot to a folder, unless it is a file already.

    Args:
        name: one of `ROBOTS`.
        folder: of the file.
    """
    if name == "docs-arm":
        return DOCS_ARM
    texts = {"planar-finger": FINGER, "pulley-finger": PULLEY_FINGER, "neck": NECK}
    path = folder / f"{name}.xml"
    write_text(path, texts[name] if name in texts else doubled(load_spec(arm_scene())))
    return path


def doubled(spec: mujoco.MjSpec) -> str:
    """MJCF text of a robot at twice its size and of the same density.

    Args:
        spec: the robot; its bodies have masses of geoms.
    """
    for body in spec.bodies:
        body.pos = 2.0 * body.pos
    for geom in spec.geoms:
        geom.pos, geom.size, geom.mass = 2.0 * geom.pos, 2.0 * geom.size, 8.0 * geom.mass
        geom.fromto = 2.0 * geom.fromto
    for site in spec.sites:
        site.pos = 2.0 * site.pos
    for camera in spec.cameras:
        camera.pos = 2.0 * camera.pos
    for joint in spec.joints:
        joint.pos, joint.armature = 2.0 * joint.pos, 32.0 * joint.armature
        joint.damping, joint.stiffness = 16.0 * joint.damping, 16.0 * joint.stiffness
    for mesh in spec.meshes:
        mesh.scale = 2.0 * mesh.scale
    for texture in spec.textures:
        texture.file = str(MARKER)
    spec.compiler.texturedir, spec.compiler.meshdir = "", str(arm_scene().parent / "meshes")
    spec.compile()
    return spec.to_xml()
