"""New elements do not depend on the default classes of the model."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from reality_gap.causes.support.new_elements import add_actuator, add_geom, add_site

OTHER = """
<general forcerange="-250 -10" forcelimited="true" ctrlrange="-1 0" ctrllimited="true"
         actrange="0 1" actlimited="true" gear="3 1 1 1 1 1" dyntype="filter" dynprm="3"
         gaintype="affine" gainprm="2 3 4" biastype="affine" biasprm="5 6 7" actearly="true"
         group="3"/>
<geom type="box" contype="0" conaffinity="0" condim="6" group="2" priority="3" friction="3 3 3"
      solmix="2" solref="0.1 2" solimp="0.1 0.2 0.3 0.4 3" margin="0.1" gap="0.05"
      rgba="1 0 0 1" density="3" mass="5"/>
<site type="box" size="0.3" group="2" rgba="1 0 0 1"/>
"""
INHERITED = ("actuator_acc0", "geom_bodyid", "site_bodyid")
"""The first depends on the masses of bodies, and the others are not attributes."""


def model_with(defaults: str, own_class: bool) -> mujoco.MjSpec:
    """A bar on a hinge with defaults of the model or of a class that its body names."""
    name, body = ("<default class='own'>", "childclass='own'") if own_class else ("", "")
    end = "</default>" if own_class else ""
    return mujoco.MjSpec.from_string(
        f"""<mujoco><default>{name}{defaults}{end}</default><worldbody>
        <body name="bar" {body}><joint name="hinge" axis="0 1 0"/>
        <inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
        <geom size="0.1 0.1 0.1"/></body></worldbody></mujoco>"""
    )


def extended(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """The model with new elements of each kind."""
    hinge = mujoco.mjtTrn.mjTRN_JOINT
    add_actuator(spec, name="motor", trntype=hinge, target="hinge")
    brake = add_actuator(spec, name="brake", trntype=hinge, target="hinge")
    brake.set_to_dcmotor(
        motorconst=[0.0, 0.0],
        resistance=1.0,
        lugre=[100.0, 1.0, 0.15, 0.15, 0.01],
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
    )
    bar = spec.body("bar")
    add_geom(bar, name="post", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.1, 0.2, 0.0], mass=0.0)
    add_site(bar, name="side", pos=[0.1, 0.2, 0.3])
    return spec


def as_compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    return spec.compile()


def as_written(spec: mujoco.MjSpec) -> mujoco.MjModel:
    spec.compile()
    return mujoco.MjModel.from_xml_string(spec.to_xml())


@pytest.mark.parametrize("own_class", [False, True], ids=["model", "childclass"])
@pytest.mark.parametrize("build", [as_compiled, as_written])
def test_new_elements_inherit_nothing(
    build: Callable[[mujoco.MjSpec], mujoco.MjModel], own_class: bool
) -> None:
    plain = build(extended(model_with("", False)))
    other = build(extended(model_with(OTHER, own_class)))
    for kind, new in (("actuator", 2), ("geom", 1), ("site", 1)):
        for name in (n for n in dir(plain) if n.startswith(f"{kind}_") and n not in INHERITED):
            value = getattr(plain, name)
            if isinstance(value, np.ndarray) and len(value):
                np.testing.assert_array_equal(getattr(other, name)[-new:], value[-new:], name)


def test_friction_is_not_limited_by_the_defaults_of_the_model() -> None:
    model = extended(model_with(OTHER, False)).compile()
    data = mujoco.MjData(model)
    for _ in range(100):
        data.qvel[0] = 1.0
        mujoco.mj_step(model, data)
    assert data.qfrc_actuator[0] == pytest.approx(-0.15, rel=0.02)
