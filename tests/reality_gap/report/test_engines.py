"""Other engines: what they lack is named, and actuators have the numbers of MuJoCo."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.extended import Effect, Extended
from reality_gap.report.actuator_configs import isaac_lab_actuators, mjlab_actuators
from reality_gap.report.engines import engine_input
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.study.data import Study
from reality_gap.study.system import compile_system
from tests.library_environments import environment

JOINTS = """
<mujoco>
  <worldbody>
    <body>
      <joint name="hip" axis="0 1 0" damping="0.4" armature="0.02" frictionloss="0.3"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>
      <body pos="0 0 -0.3">
        <joint name="knee" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="belt"><joint joint="hip" coef="1"/></fixed></tendon>
  <actuator>
    <position name="hip" joint="hip" kp="50" kv="2" forcerange="-20 20"/>
    <position name="knee" joint="knee" kp="10" gear="3" forcerange="-5 4"/>
    <position name="belt" tendon="belt" kp="7"/>
    <motor name="thrust" joint="knee"/>
  </actuator>
</mujoco>
"""


@pytest.fixture
def rubbed(lever_study: Study) -> mujoco.MjSpec:
    """The lever with dry friction of its flexor, as a diagnosis extends it."""
    system, cause = compile_system(lever_study), find_cause("coulomb_friction")
    location = next(p for p in cause.locations(system) if p.elements == ("flexor",))
    candidate = Candidate(cause, location, cause.parameters(system, location))
    return build(system, [(candidate, candidate.null_values() | {"friction": 3.0})]).spec


def test_friction_with_a_state_becomes_friction_loss_for_mjx(rubbed: mujoco.MjSpec) -> None:
    found = engine_input(rubbed, "mjx")
    model = found.spec.compile()

    assert model.tendon_frictionloss[model.tendon("flexor").id] == pytest.approx(3.0)
    assert len(found.replaced) == 1
    assert "coulomb_friction/flexor is friction loss of flexor, 3 N, without" in found.replaced[0]
    assert found.lacking == ()
    names = [model.actuator(i).name for i in range(model.nactuator)]
    assert names == ["flexor", "extensor"]


@pytest.mark.slow
def test_a_step_of_mjx_is_that_of_mujoco(
    lever_study: Study, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Of the lever as it is, and as diagnoses extend it, in motion."""
    system, chosen, paths = compile_system(lever_study), [], []
    for id, value in (
        ("coulomb_friction", {"friction": 3.0}),
        ("viscous_friction", {"damping": 40.0}),
        ("force_scale", {"excess": 0.3}),
        ("length_offset", {"offset": 0.002}),
    ):
        model = build(system, chosen).spec
        paths.append(tmp_path / f"{len(chosen)}.xml")
        paths[-1].write_text(engine_input(model, "mjx").spec.to_xml(), encoding="utf-8")
        cause = find_cause(id)
        location = next(p for p in cause.locations(system) if "flexor" in p.elements)
        candidate = Candidate(cause, location, cause.parameters(system, location))
        chosen.append((candidate, candidate.null_values() | value))
    python = environment(request.config, "mujoco-mjx", f"mujoco=={mujoco.__version__}")
    program = Path(__file__).with_name("mjx_steps.py")
    ended = subprocess.run(
        [python, program, *paths],
        env={**os.environ, "JAX_PLATFORMS": "cpu", "PYTHONPATH": ""},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr[-4000:]
    for found in json.loads(ended.stdout.splitlines()[-1]):
        assert found["difference"] < 1e-4
        assert found["change"] > 1e-3, "a lever at rest shows nothing"


def test_warp_has_the_friction_with_a_state(rubbed: mujoco.MjSpec) -> None:
    found = engine_input(rubbed, "warp")

    assert (found.replaced, found.lacking) == ((), ())
    assert found.spec.compile().nactuator == rubbed.compile().nactuator


def test_what_an_engine_lacks_is_named() -> None:
    spec = mujoco.MjSpec.from_string(JOINTS)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICIT
    spec.actuator("thrust").set_to_dcmotor(motorconst=[0.1, 0.1], resistance=1.0)

    assert engine_input(spec, "mjx").lacking == (
        "the actuator thrust is dyntype DCMOTOR, not in MJX",
        "the actuator thrust is gaintype DCMOTOR, not in MJX",
        "the actuator thrust is biastype DCMOTOR, not in MJX",
        "the integrator is IMPLICIT, not in MJX",
    )
    assert engine_input(spec, "warp").lacking == ()


def test_an_unknown_engine_is_named() -> None:
    with pytest.raises(UnknownNameError, match="unknown engine 'gazebo'; known: mjx, warp"):
        engine_input(mujoco.MjSpec(), "gazebo")  # type: ignore[arg-type]


def test_isaac_lab_gets_joints_in_si_units() -> None:
    found = isaac_lab_actuators(mujoco.MjSpec.from_string(JOINTS))

    (arguments,) = found.arguments
    assert arguments == {
        "joint_names_expr": ["hip", "knee"],
        "stiffness": {"hip": 50.0, "knee": 90.0},
        "damping": {"hip": 2.0, "knee": 0.0},
        "armature": {"hip": 0.02, "knee": 0.0},
        "friction": {"hip": 0.3, "knee": 0.0},
        "dynamic_friction": {"hip": 0.3, "knee": 0.0},
        "viscous_friction": {"hip": 0.4, "knee": 0.0},
        "effort_limit_sim": {"hip": 20.0, "knee": 15.0},
    }
    assert found.lacking == (
        "the forces of the actuator knee are from -5 to 4",
        "commands of the actuator knee are 3 times those of its element",
        "the actuator of belt pulls a tendon, not a joint",
        "the actuator thrust is no position servo",
    )


def test_a_drive_of_the_exported_numbers_moves_as_the_servo() -> None:
    """Torque of the servo = stiffness (target - angle) - damping speed, also through a gear."""
    model = mujoco.MjModel.from_xml_string(JOINTS)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:2] = (0.1, 0.05), (0.3, -0.2), (0.2, 0.3)
    mujoco.mj_forward(model, data)
    (arguments,) = isaac_lab_actuators(mujoco.MjSpec.from_string(JOINTS)).arguments
    stiffness, damping = (list(arguments[key].values()) for key in ("stiffness", "damping"))
    target = np.array([0.2, 0.3 / 3.0])

    torque = np.array(stiffness) * (target - data.qpos) - np.array(damping) * data.qvel

    own = data.actuator_force[:2] * model.actuator_gear[:2, 0]
    np.testing.assert_allclose(torque, own)


@pytest.mark.parametrize("gear", [3.0, 0.5, -2.0])
def test_a_drive_damps_as_the_servo_does_through_its_gear(gear: float) -> None:
    servo = f'<position name="a" joint="hip" kp="50" kv="2" gear="{gear}"/>'
    spec = mujoco.MjSpec.from_string(
        re.sub(r"<actuator>.*</actuator>", f"<actuator>{servo}</actuator>", JOINTS, flags=re.S)
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0], data.ctrl[0] = 0.3, -1.7, 0.4
    mujoco.mj_forward(model, data)

    (given,) = isaac_lab_actuators(spec).arguments
    target = data.ctrl[0] / gear
    expected = given["stiffness"]["hip"] * (target - 0.3) + given["damping"]["hip"] * 1.7

    assert data.qfrc_actuator[0] == pytest.approx(expected)


def test_mjlab_gets_tendons_too(rubbed: mujoco.MjSpec) -> None:
    found = mjlab_actuators(rubbed)

    flexor, extensor = found.arguments
    assert flexor["target_names_expr"] == ("flexor",)
    assert flexor["transmission_type"] == extensor["transmission_type"] == "tendon"
    assert (flexor["stiffness"], flexor["effort_limit"]) == (5000.0, 400.0)
    assert (flexor["frictionloss"], extensor["frictionloss"]) == (pytest.approx(3.0), 0.0)
    assert "the actuator flexor adds a constant force of -10 N" in found.lacking
    assert "the forces of the actuator flexor are from -400 to -10" in found.lacking


def one_joint(actuators: str, joint: str = "") -> mujoco.MjSpec:
    """A link on a hinge or another joint, with the actuators."""
    return mujoco.MjSpec.from_string(f"""
<mujoco>
  <worldbody><body>
    <joint name="hip" {joint}/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>
  </body></worldbody>
  <actuator>{actuators}</actuator>
</mujoco>""")


@pytest.mark.parametrize("configs", [isaac_lab_actuators, mjlab_actuators])
@pytest.mark.parametrize(
    ("actuators", "joint", "count", "sentence"),
    [
        (
            '<position name="a" joint="hip" kp="50" gear="-1"/>',
            "",
            1,
            "commands of the actuator a are -1 times those of its element",
        ),
        (
            '<position name="a" joint="hip" kp="50" gear="0"/>',
            "",
            0,
            "the actuator a does not move hip, with a gear of 0",
        ),
        (
            '<position name="a" joint="hip" kp="5"/><position name="b" joint="hip" kp="7"/>',
            "",
            1,
            "the actuator b is a second servo of hip",
        ),
        (
            '<position name="a" joint="hip" kp="50"/>',
            'type="ball"',
            0,
            "the actuator a moves hip, which is neither a hinge nor a slide",
        ),
        (
            '<general name="a" joint="hip" gainprm="-50" biastype="affine" biasprm="0 50 0"/>',
            "",
            0,
            "the actuator a has a negative stiffness or damping",
        ),
        (
            '<position name="a" joint="hip" kp="50" ctrlrange="-1 2"/>',
            "",
            1,
            "commands of the actuator a are limited to -1 to 2",
        ),
        (
            '<position name="a" joint="hip" kp="50"/>',
            'actuatorfrcrange="-3 4"',
            1,
            "the forces of all actuators of hip are from -3 to 4",
        ),
    ],
)
def test_what_a_configuration_lacks_is_named(
    configs: Any, actuators: str, joint: str, count: int, sentence: str
) -> None:
    found = configs(one_joint(actuators, joint))

    assert found.lacking == (sentence,)
    assert len(found.arguments) == count


@pytest.mark.parametrize(
    ("forcerange", "limit"),
    [("", 4.0), ('forcerange="-1 1"', 2.0), ('forcerange="-10 10"', 4.0)],
)
def test_the_limit_of_a_joint_is_exported(forcerange: str, limit: float) -> None:
    """MuJoCo clamps the force of a servo first at the actuator, and then at the joint."""
    servo = f'<position name="a" joint="hip" kp="1000" gear="2" {forcerange}/>'
    spec = one_joint(servo, 'actuatorfrcrange="-4 4"')
    data = mujoco.MjData(model := spec.compile())
    data.ctrl[:] = 1.0
    mujoco.mj_forward(model, data)

    assert data.qfrc_actuator[0] == limit
    (arguments,) = isaac_lab_actuators(spec).arguments
    assert arguments["effort_limit_sim"] == {"hip": limit}
    assert mjlab_actuators(spec).arguments[0]["effort_limit"] == limit


def test_names_are_escaped_in_regular_expressions() -> None:
    spec = mujoco.MjSpec.from_string(JOINTS.replace('"hip"', '"hip.*[0]"'))

    (isaac,) = isaac_lab_actuators(spec).arguments
    patterns = [
        isaac["joint_names_expr"][0],
        *mjlab_actuators(spec).arguments[0]["target_names_expr"],
    ]
    assert list(isaac["stiffness"]) == isaac["joint_names_expr"]
    for pattern in patterns:
        assert re.fullmatch(pattern, "hip.*[0]")
        assert not re.fullmatch(pattern, "hip_0")


@pytest.mark.parametrize(
    "configs", [isaac_lab_actuators, mjlab_actuators, lambda given: engine_input(given, "mjx")]
)
@pytest.mark.parametrize("given", [None, Path("extended"), one_joint("").compile()])
def test_only_an_extended_model_or_a_spec_is_taken(configs: Any, given: Any) -> None:
    with pytest.raises(StudyError, match=r"must be an extended one, such as .*, not of the type"):
        configs(given)


WITHOUT_NAMES = """<mujoco>
  <worldbody><body><joint name="knee"/><geom size="0.1"/></body></worldbody>
  <actuator><motor joint="knee"/><position joint="knee" kp="5" gear="2"/></actuator></mujoco>"""


def test_an_actuator_without_a_name_has_its_number_in_sentences() -> None:
    lacking = mjlab_actuators(mujoco.MjSpec.from_string(WITHOUT_NAMES)).lacking
    assert lacking == (
        "the actuator number 0 is no position servo",
        "commands of the actuator number 1 are 2 times those of its element",
    )


@pytest.mark.parametrize(
    "export",
    [isaac_lab_actuators, mjlab_actuators, lambda model: engine_input(model, "warp")],
)
def test_effects_beside_an_extended_model_are_lacking(export: Callable[[object], Any]) -> None:
    cause = find_cause("backlash")
    effect = Effect(cause, Location("joint", ("knee",)), {"gap": 0.01})
    spec = mujoco.MjSpec.from_string(JOINTS)
    alone, beside = export(spec).lacking, export(Extended(spec, (effect,))).lacking
    assert beside == ("backlash at knee is not in the model, but beside it", *alone)


@pytest.mark.parametrize(("kind", "unit"), [("hinge", "N m"), ("slide", "N")])
def test_forces_have_the_unit_of_their_joint(kind: str, unit: str) -> None:
    spec = mujoco.MjSpec.from_string(f"""<mujoco>
      <worldbody><body><joint name="knee" type="{kind}"/><geom size="0.1"/></body></worldbody>
      <actuator>
        <general name="pushed" joint="knee" biastype="affine" gainprm="5" biasprm="2 -5"/>
      </actuator></mujoco>""")
    brake = spec.add_actuator(name="brake", trntype=mujoco.mjtTrn.mjTRN_JOINT, target="knee")
    brake.set_to_dcmotor(
        motorconst=[0.0, 0.0],
        resistance=1.0,
        lugre=[300.0, 1.0, 3.0, 3.0, 0.1],
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
    )
    [sentence] = engine_input(spec, "mjx").replaced
    assert f"friction loss of knee, 3 {unit}, without" in sentence
    assert f"the actuator pushed adds a constant force of 2 {unit}" in mjlab_actuators(spec).lacking
