"""Models without visual elements: they move as before, and are small."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from reality_gap.simulation.light_model import can_collide, light_spec, without_distant_meshes

SPHERE = " ".join(
    f"{x:.4f}" for x in np.random.default_rng(0).standard_normal((2000, 3)).ravel() / 10
)
MODEL = f"""
<mujoco>
  <asset><mesh name="shape" vertex="{SPHERE}"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" pos="0 0 -2"/>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0"/>
      <geom name="skin" type="mesh" mesh="shape" contype="0" conaffinity="0" mass="0.5"/>
      <geom name="bone" type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/>
      <site name="a" pos="0 0 0.05"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0"/>
        <geom name="shin" type="mesh" mesh="shape" mass="0.4" contype="2" conaffinity="4"/>
        <geom name="pulley" type="sphere" size="0.03" contype="0" conaffinity="0" mass="0.1"/>
        <site name="b" pos="0.1 0 0.05"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="wire"><site site="a"/><geom geom="pulley"/><site site="b"/></spatial>
  </tendon>
  <sensor><tendonpos name="length" tendon="wire"/></sensor>
</mujoco>
"""


def swing(spec: mujoco.MjSpec) -> np.ndarray:
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 400)
    return np.r_[data.qpos, data.qvel, data.sensordata]


def test_a_light_model_moves_as_before_and_is_small() -> None:
    spec = mujoco.MjSpec.from_string(MODEL)
    text = spec.to_xml()
    light = light_spec(spec)
    assert [geom.name for geom in light.geoms] == ["floor", "bone", "pulley"]
    assert not light.meshes
    np.testing.assert_allclose(swing(light), swing(spec), rtol=1e-9)
    assert light.compile().nbuffer < 0.2 * spec.compile().nbuffer
    assert spec.to_xml() == text


def test_a_model_whose_contacts_do_not_count_keeps_what_tendons_wrap_around() -> None:
    spec = mujoco.MjSpec.from_string(MODEL)
    light = light_spec(spec, contacts=False)
    assert [geom.name for geom in light.geoms] == ["pulley"]
    masses, own = light.compile(), spec.compile()
    np.testing.assert_allclose(masses.body_mass, own.body_mass)
    np.testing.assert_allclose(masses.body_inertia, own.body_inertia)


def test_a_model_without_meshes_stays_as_it_is() -> None:
    spec = mujoco.MjSpec.from_string(MODEL.replace('type="mesh" mesh="shape"', 'size="0.1"'))
    spec.delete(spec.meshes[0])
    assert light_spec(spec).to_xml() == spec.to_xml()


def test_a_model_whose_sensors_see_visual_geoms_stays_as_it_is() -> None:
    seeing = MODEL.replace("<tendonpos", '<rangefinder site="b"/><tendonpos')
    spec = mujoco.MjSpec.from_string(seeing)
    light = light_spec(spec)
    assert light.to_xml() == spec.to_xml()
    np.testing.assert_array_equal(swing(light), swing(spec))


@pytest.mark.parametrize(
    ("edit", "colliding"),
    [
        ("", {"floor", "bone"}),
        ('<contact><pair geom1="skin" geom2="floor"/></contact>', {"floor", "bone", "skin"}),
        ('<contact><exclude body1="world" body2="upper"/></contact>', set()),
        ('<option><flag filterparent="disable"/></option>', {"floor", "bone"}),
    ],
)
def test_geoms_collide_by_the_filters_of_mujoco(edit: str, colliding: set[str]) -> None:
    model = mujoco.MjModel.from_xml_string(MODEL.replace("</mujoco>", f"{edit}</mujoco>"))
    found = {model.geom(i).name for i in np.flatnonzero(can_collide(model))}
    assert found == colliding


ARM = f"""
<mujoco>
  <asset><mesh name="shape" vertex="{SPHERE}"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 1" pos="0 0 -2"/>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="1"/>
      <geom name="hull" type="mesh" mesh="shape" mass="1"/>
      <body name="middle" pos="0.5 0 0">
        <joint name="elbow" axis="0 1 0" damping="1"/>
        <geom name="forearm" type="mesh" mesh="shape" mass="0.5"/>
        <body name="lower" pos="0.5 0 0">
          <joint name="wrist" axis="0 1 0" damping="1"/>
          <geom name="hand" type="mesh" mesh="shape" mass="0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def motion(angles: np.ndarray) -> np.ndarray:
    return np.column_stack([np.zeros_like(angles), angles, np.zeros_like(angles)])


def test_meshes_that_touch_nothing_in_a_motion_are_left_out_of_it() -> None:
    spec = mujoco.MjSpec.from_string(ARM)
    light = without_distant_meshes(spec, motion(np.linspace(-0.3, 0.3, 30)))
    assert [geom.name for geom in light.geoms] == ["floor"]
    np.testing.assert_allclose(swing(light), swing(spec), rtol=1e-9)


def test_meshes_that_come_close_in_a_motion_stay() -> None:
    spec = mujoco.MjSpec.from_string(ARM)
    folded = without_distant_meshes(spec, motion(np.linspace(0.0, 3.0, 200)))
    assert {"hull", "hand"} <= {geom.name for geom in folded.geoms}


def test_meshes_that_a_sensor_sees_stay() -> None:
    seen = '<sensor><distance geom1="hull" geom2="hand" cutoff="1"/></sensor></mujoco>'
    spec = mujoco.MjSpec.from_string(ARM.replace("</mujoco>", seen))
    light = without_distant_meshes(spec, motion(np.zeros(3)))
    assert [geom.name for geom in light.geoms] == ["floor", "hull", "forearm", "hand"]
