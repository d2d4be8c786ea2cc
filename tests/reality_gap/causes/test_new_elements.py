"""New elements do not depend on the default classes of the model."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.support.new_elements import add_actuator, add_geom, add_site, add_tendon
from reality_gap.simulation.episode import compile_with_probes
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.study.system import System, compile_system
from tests.reality_gap.causes.machines import (
    arm_study,
    candidates_of,
    elbow_study,
    hand_study,
    screw_study,
    towards_null,
)

OTHER = """
<general forcerange="-250 -10" forcelimited="true" ctrlrange="-1 0" ctrllimited="true"
         actrange="0 1" actlimited="true" gear="3 1 1 1 1 1" dyntype="filter" dynprm="3"
         gaintype="affine" gainprm="2 3 4" biastype="affine" biasprm="5 6 7" actearly="true"
         group="3"/>
<geom type="box" contype="0" conaffinity="0" condim="6" group="2" priority="3" friction="3 3 3"
      solmix="2" solref="0.1 2" solimp="0.1 0.2 0.3 0.4 3" margin="0.1" gap="0.05"
      rgba="1 0 0 1" density="3" mass="5"/>
<site type="box" size="0.3" group="2" rgba="1 0 0 1"/>
<tendon damping="4" stiffness="9" frictionloss="5" armature="2" limited="true" range="0 0.01"
        group="2" margin="0.1" solreflimit="0.1 2" springlength="0.1 0.2"/>
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
    add_tendon(spec, name="coupling").wrap_joint("hinge", 2.0)
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
    for kind, new in (("actuator", 2), ("geom", 1), ("site", 1), ("tendon", 1)):
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


WRITTEN = {"tendon_lengthspring", "tendon_width"}
"""A model that MuJoCo writes has explicit rest lengths, also of tendons without stiffness, and no
widths of fixed tendons, which are not seen."""


def set_odd_defaults(default: mujoco.MjsDefault) -> None:
    """Give each class of elements attributes that no element of a model should inherit."""
    default.joint.damping[:], default.joint.stiffness[:] = 7.0, 30.0
    default.joint.armature, default.joint.frictionloss, default.joint.springref = 0.5, 4.0, 0.3
    default.joint.limited, default.joint.range = 1, (-0.1, 0.1)
    default.joint.actfrclimited, default.joint.actfrcrange = 1, (-0.1, 0.1)
    default.joint.margin, default.joint.actgravcomp, default.joint.group = 0.2, 1, 3
    default.geom.type, default.geom.size = mujoco.mjtGeom.mjGEOM_CYLINDER, (0.3, 0.3, 0.0)
    default.geom.contype, default.geom.conaffinity, default.geom.density = 1, 1, 9000.0
    default.geom.group, default.geom.margin, default.geom.fluid_ellipsoid = 2, 0.1, 1
    default.site.type, default.site.size[0] = mujoco.mjtGeom.mjGEOM_CYLINDER, 0.2
    default.site.group = 2
    default.tendon.damping[:], default.tendon.stiffness[:] = 40.0, 900.0
    default.tendon.frictionloss, default.tendon.armature = 5.0, 2.0
    default.tendon.limited, default.tendon.range, default.tendon.width = 1, (0.0, 0.01), 0.2
    default.tendon.actfrclimited, default.tendon.actfrcrange = 1, (-1.0, 0.0)
    default.actuator.forcelimited, default.actuator.forcerange = 1, (-1.0, -0.5)
    default.actuator.ctrllimited, default.actuator.ctrlrange = 1, (-0.1, 0.0)
    default.actuator.gear[0], default.actuator.gainprm[0] = 3.0, 5.0
    default.actuator.dyntype, default.actuator.dynprm[0] = mujoco.mjtDyn.mjDYN_FILTER, 2.0
    default.equality.active, default.equality.solref = 0, (0.5, 2.0)
    default.camera.fovy, default.camera.ipd = 10.0, 0.3
    default.light.castshadow, default.light.cutoff = 0, 5.0
    default.mesh.maxhullvert, default.material.shininess, default.pair.condim = 9, 0.9, 6


@pytest.fixture(scope="module", params=["model", "childclass"])
def twins(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> list[tuple[System, System]]:
    """Systems, each with one whose elements are the same but whose defaults are odd."""
    folder, found = tmp_path_factory.mktemp("twins"), []
    kinds = (elbow_study, arm_study, hand_study, screw_study, partial(screw_study, effort=True))
    for study in (make(folder) for make in kinds):
        spec = mujoco.MjSpec.from_file(str(study.model))
        if request.param == "model":
            set_odd_defaults(spec.default)
        else:
            set_odd_defaults(spec.add_default("odd", spec.default))
            for body in spec.worldbody.find_all("body"):
                body.childclass = "odd"
        spec.compile()
        path = folder / f"{study.name}-odd.xml"
        path.write_text(spec.to_xml())
        odd = dataclasses.replace(study, model=path)
        found.append((compile_system(study), compile_system(odd)))
    return found


@pytest.mark.parametrize("id", CATALOGUE)
def test_causes_do_not_depend_on_the_defaults_of_a_model(
    twins: list[tuple[System, System]], id: str
) -> None:
    """Whatever is added or edited is explicit, for each class of elements."""
    for plain, odd in twins:
        for candidate in candidates_of(plain, id):
            one, other = (built(system, candidate) for system in (plain, odd))
            for name in (n for n in dir(one) if isinstance(getattr(one, n), np.ndarray)):
                if name in WRITTEN:
                    continue
                np.testing.assert_allclose(
                    getattr(other, name), getattr(one, name), rtol=1e-5, atol=1e-9, err_msg=name
                )


def built(system: System, candidate: Candidate) -> mujoco.MjModel:
    """The model with a cause, and with the sensors that replays add."""
    values = towards_null(candidate, 1.0)
    return compile_with_probes(build(system, [(candidate, values)]).spec, fuse=False)
