"""Causes of position servos and joints: each is the model that a person would edit by hand."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.actuator_lag import COMMAND
from reality_gap.causes.base import Location
from reality_gap.causes.joint_stiffness import NOMINAL
from reality_gap.causes.support.encoders import POSITION, READING
from reality_gap.causes.support.shared_amounts import FACTOR
from reality_gap.inference.paying import NEAR, distance_to_bound
from reality_gap.simulation.hypothesis import build
from reality_gap.study.measurements import measured
from reality_gap.study.system import System, compile_system
from tests.reality_gap.causes.candidates import candidate, with_cause
from tests.reality_gap.causes.machines import predict
from tests.reality_gap.causes.plants import system_of

BOTH = ("shoulder", "elbow")
ELBOW = Location("actuator", ("elbow",))
MOTORS = Location("actuator", BOTH)
AT_ELBOW = Location("joint", ("elbow",))
COUNT = itertools.count()
Edit = Callable[[mujoco.MjSpec], None]


def edited(system: System, edit: Edit) -> System:
    """The same study with a model that was edited by hand."""
    spec = system.study.spec()
    edit(spec)
    path = system.study.model.with_name(f"by-hand-{next(COUNT)}.xml")
    spec.compile()
    path.write_text(spec.to_xml())
    return compile_system(replace(system.study, model=path))


def scale_gain(*names: str, kp: float = 1.0, kd: float = 1.0, command: float = 1.0) -> Edit:
    def edit(spec: mujoco.MjSpec) -> None:
        for name in names:
            actuator = spec.actuator(name)
            actuator.gainprm[0] *= kp * command
            actuator.biasprm[1] *= kp
            actuator.biasprm[2] *= kd

    return edit


def scale_joint(attribute: str, factor: float, *names: str) -> Edit:
    def edit(spec: mujoco.MjSpec) -> None:
        for name in names:
            setattr(spec.joint(name), attribute, factor * getattr(spec.joint(name), attribute))

    return edit


def limit(factor: float, *names: str) -> Edit:
    def edit(spec: mujoco.MjSpec) -> None:
        for name in names:
            spec.actuator(name).forcerange = factor * np.array(spec.actuator(name).forcerange)

    return edit


@pytest.mark.parametrize(
    ("id", "location", "values", "edit"),
    [
        ("position_gain", ELBOW, {"excess": -0.4}, scale_gain("elbow", kp=0.6)),
        ("position_gain", MOTORS, {"excess": -0.4}, scale_gain(*BOTH, kp=0.6)),
        ("velocity_gain", ELBOW, {"excess": 0.8}, scale_gain("elbow", kd=1.8)),
        ("velocity_gain", MOTORS, {"excess": -1.0}, scale_gain(*BOTH, kd=0.0)),
        ("command_gain", ELBOW, {"excess": 0.1}, scale_gain("elbow", command=1.1)),
        ("force_limit", ELBOW, {"limit": 1.0}, limit(0.5, "elbow")),
        ("force_limit", MOTORS, {"excess": -0.5}, limit(0.5, *BOTH)),
        ("armature", AT_ELBOW, {"inertia": 0.02}, scale_joint("armature", 3.0, "elbow")),
        ("armature", AT_ELBOW, {"inertia": -0.01}, scale_joint("armature", 0.0, "elbow")),
        ("armature", Location("joint", BOTH), {"inertia": 0.01}, scale_joint("armature", 2, *BOTH)),
        ("viscous_friction", AT_ELBOW, {"damping": -0.4}, scale_joint("damping", 0.0, "elbow")),
        (
            "viscous_friction",
            Location("joint", BOTH),
            {"damping": -0.2},
            scale_joint("damping", 0.5, *BOTH),
        ),
        ("coulomb_friction", AT_ELBOW, {"friction": -0.1}, scale_joint("frictionloss", 0, "elbow")),
        (
            "joint_stiffness",
            Location("joint", ("elbow",), NOMINAL),
            {"excess": 4.0},
            scale_joint("stiffness", 5.0, "elbow"),
        ),
    ],
)
def test_a_cause_is_the_model_edited_by_hand(
    systems: dict[str, System], id: str, location: Location, values: dict[str, float], edit: Edit
) -> None:
    system = systems["arm"]
    found = with_cause(system, id, location, **values)

    assert np.abs(found - predict(system)).max() > 1.0
    np.testing.assert_allclose(found, predict(edited(system, edit)), atol=1e-3)


def filtered(*seconds: float) -> Edit:
    """Commands pass a filter with these time constants."""

    def edit(spec: mujoco.MjSpec) -> None:
        for name, tau in zip(BOTH, seconds, strict=True):
            actuator = spec.actuator(name)
            actuator.dyntype, actuator.actearly = mujoco.mjtDyn.mjDYN_FILTER, True
            actuator.dynprm[0] = tau

    return edit


def test_a_filter_may_be_modelled_too_slow(systems: dict[str, System]) -> None:
    model = edited(systems["arm"], filtered(0.1, 0.05))
    on = Location(MOTORS.kind, MOTORS.elements, COMMAND)
    [lag] = candidate(model, "actuator_lag", on).parameters

    found = with_cause(model, "actuator_lag", on, time_constant=-0.03)

    assert np.abs(found - predict(model)).max() > 1.0
    expected = predict(edited(systems["arm"], filtered(0.07, 0.02)))
    np.testing.assert_allclose(found, expected, atol=1e-3)
    # A filter that is faster than the time step would diverge.
    assert lag.low == pytest.approx(model.model.opt.timestep - 0.05)
    assert np.isfinite(with_cause(model, "actuator_lag", on, time_constant=lag.low)).all()
    assert distance_to_bound((candidate(model, "actuator_lag", on), {lag.name: lag.low})) > NEAR
    [plain] = candidate(systems["arm"], "actuator_lag", on).parameters
    assert plain.low == 0.0


@pytest.mark.parametrize(("names", "factor"), [(("elbow",), 1.1), (BOTH, 0.8)])
def test_more_turns_of_a_motor_are_more_force_and_a_larger_error(
    systems: dict[str, System], names: tuple[str, ...], factor: float
) -> None:
    """The sensors of the actuators read the force before the gear."""

    def edit(spec: mujoco.MjSpec) -> None:
        scale_gain(*names, kp=factor**2, kd=factor**2, command=1.0 / factor)(spec)
        limit(factor, *names)(spec)

    system = systems["arm"]
    found = with_cause(system, "gear_ratio", Location("actuator", names), excess=factor - 1.0)
    expected = predict(edited(system, edit))
    channels = system.study.channels
    channel = measured(system.study).channel
    force = int(mujoco.mjtSensor.mjSENS_ACTUATORFRC)
    motors = [system.model.actuator(name).id for name in names]
    for i, sensor in enumerate(system.model.sensor(c.sensor) for c in channels):
        before = factor if sensor.type[0] == force and sensor.objid[0] in motors else 1.0
        np.testing.assert_allclose(before * found[channel == i], expected[channel == i], atol=1e-3)


def test_joints_with_different_values_are_wrong_by_one_factor(systems: dict[str, System]) -> None:
    system = edited(systems["arm"], scale_joint("damping", 3.0, "shoulder"))
    both = Location("joint", BOTH, FACTOR)
    found = with_cause(system, "viscous_friction", both, excess=-0.5)

    expected = predict(edited(system, scale_joint("damping", 0.5, *BOTH)))
    np.testing.assert_allclose(found, expected, atol=1e-3)


@pytest.mark.parametrize(
    ("id", "name"),
    [
        ("viscous_friction", "damping"),
        ("armature", "armature"),
        ("coulomb_friction", "frictionloss"),
    ],
)
def test_at_most_all_there_is_can_be_taken_away(
    systems: dict[str, System], id: str, name: str
) -> None:
    """A fit cannot pass the absence, to the mirror image of the right value."""

    def add(spec: mujoco.MjSpec) -> None:
        joint = spec.joint("elbow")
        joint.armature, joint.frictionloss = 0.03, 0.2

    system = edited(systems["arm"], add)
    less = candidate(system, id, AT_ELBOW)
    p = less.parameters[0]

    found, nearly = (
        with_cause(system, id, AT_ELBOW, **{p.name: share * p.low}) for share in (1.0, 0.9)
    )
    without = predict(edited(system, scale_joint(name, 0.0, "elbow")))

    assert p.hints.absence
    assert np.abs(without - nearly).max() > 1e-4
    np.testing.assert_allclose(found, without, atol=1e-6)


def test_what_is_absent_is_not_at_a_bound(systems: dict[str, System]) -> None:
    """Damping of 0.4 may be absent; more cannot be taken away."""
    system = systems["arm"]
    damping = candidate(system, "viscous_friction", AT_ELBOW)
    [p] = damping.parameters
    none, less_than_none = (
        with_cause(system, "viscous_friction", AT_ELBOW, damping=d) for d in (-0.4, -0.44)
    )

    assert p.low == pytest.approx(-0.4)
    assert distance_to_bound((damping, {"damping": p.low})) > NEAR
    assert distance_to_bound((damping, {"damping": p.high})) < NEAR
    np.testing.assert_array_equal(none, less_than_none)


def test_gravity_compensation_of_all_is_that_of_mujoco(systems: dict[str, System]) -> None:
    """Positions are those of a model whose bodies weigh 60 % less; efforts include the share."""
    system = edited(systems["arm"], limit(10.0, *BOTH))

    def lighten(spec: mujoco.MjSpec) -> None:
        for name in ("upper", "lower"):
            spec.body(name).gravcomp = 0.6

    found = with_cause(system, "gravity_compensation", MOTORS, share=0.6)
    expected = predict(edited(system, lighten))
    readings = measured(system.study)
    positions = np.isin(readings.channel, (0, 1))
    before = np.abs(predict(system) - expected)[positions].max()

    assert np.abs(found - expected)[positions].max() < 0.01 * before
    assert np.abs(found - expected)[readings.channel == 3].max() > 1.0, "part of the motor's force"


def test_a_compensation_of_the_model_may_be_absent(systems: dict[str, System]) -> None:
    def lighten(spec: mujoco.MjSpec) -> None:
        for name in ("upper", "lower"):
            spec.body(name).gravcomp = 1.0

    system = edited(systems["arm"], lighten)
    [with_it] = candidate(system, "gravity_compensation", ELBOW).parameters
    [without] = candidate(systems["arm"], "gravity_compensation", ELBOW).parameters

    assert with_it.low < -1.0
    assert without.low == 0.0


@pytest.mark.parametrize(
    ("id", "values"), [("encoder_scale", 0.05), ("joint_offset", 0.05), ("backlash", 0.12)]
)
def test_an_error_of_the_log_moves_nothing(
    systems: dict[str, System], id: str, values: float
) -> None:
    system = systems["arm"]
    name = candidate(system, id, AT_ELBOW).parameters[0].name
    own, log = (
        np.abs(with_cause(system, id, location, **{name: values}) - predict(system))
        for location in (AT_ELBOW, Location("joint", ("elbow",), READING))
    )
    force = measured(system.study).channel == 4

    assert own[force].max() > 0.5
    assert log[force].max() < 1e-9
    assert log.max() > 0.05


@pytest.mark.parametrize("id", ["encoder_scale", "joint_offset", "backlash"])
def test_a_log_deviates_less_from_its_servo_than_an_encoder_from_its_joint(
    systems: dict[str, System], id: str
) -> None:
    """Both have the same readings, so that hardly any good model has an error of the log alone."""
    at = Location("joint", ("elbow",), READING)
    own, log = (candidate(systems["arm"], id, one).parameters[0] for one in (AT_ELBOW, at))

    assert 0.0 < log.tolerance == pytest.approx(0.2 * own.tolerance)
    assert log.scale == own.scale


def test_a_servo_with_a_wrong_gear_ratio_reads_its_command(systems: dict[str, System]) -> None:
    """The servo reaches the command in its own reading, whatever its encoder's scale is."""
    system = systems["arm"]
    one = candidate(system, "encoder_scale", AT_ELBOW)
    plant = build(system, [(one, {"scale": 0.2})])
    model = plant.spec.compile()

    assert model.actuator("elbow").biasprm[1] == pytest.approx(-30 * 1.2)
    assert model.actuator("elbow").gainprm[0] == pytest.approx(30)


@pytest.mark.parametrize(
    ("id", "location", "values", "factor"),
    [
        ("position_gain", ELBOW, {"excess": 3.0}, 1.0),
        ("command_gain", ELBOW, {"excess": 1e-6}, 1.0),
        ("gear_ratio", ELBOW, {"excess": 0.05}, 1.0),
        ("encoder_scale", AT_ELBOW, {"scale": 1e-6}, 1.0),
        ("armature", AT_ELBOW, {"inertia": 0.01}, 1.0),
        ("force_scale", ELBOW, {"excess": 0.05}, 1.05),
    ],
)
def test_a_damping_ratio_is_a_gain_that_other_causes_do_not_change(
    systems: dict[str, System],
    id: str,
    location: Location,
    values: dict[str, float],
    factor: float,
) -> None:
    def set_ratio(spec: mujoco.MjSpec) -> None:
        spec.actuator("elbow").biasprm[2] = 0.7  # MuJoCo's dampratio

    system = edited(systems["arm"], set_ratio)
    one = candidate(system, id, location)
    found = build(system, [(one, one.null_values() | values)]).spec.compile()

    damping = system.model.actuator("elbow").biasprm[2]
    assert damping < 0.0
    assert found.actuator("elbow").biasprm[2] == pytest.approx(factor * damping, rel=1e-5)


@pytest.mark.parametrize(("kind", "axis"), [("hinge", "0 1 0"), ("slide", "0 0 1")])
def test_compensation_of_all_gravity_carries_the_load(tmp_path: Path, kind: str, axis: str) -> None:
    path = tmp_path / "one.xml"
    path.write_text(f'''<mujoco><worldbody><body><joint name="j" type="{kind}" axis="{axis}"/>
      <geom size="0.05" pos="0.3 0 0" mass="2"/></body></worldbody>
      <actuator><motor name="m" joint="j" gear="50"/></actuator>
      <sensor><jointpos joint="j"/></sensor></mujoco>''')
    system = system_of(path)
    one = candidate(system, "gravity_compensation", Location("actuator", ("m",)))
    plant = build(system, [(one, {"share": 1.0})])
    model = plant.spec.compile()
    data = mujoco.MjData(model)
    plant.effects.hooks[0].make(model)(model, data)
    mujoco.mj_forward(model, data)

    np.testing.assert_allclose(data.qfrc_actuator, data.qfrc_bias)


def test_the_limit_of_a_joint_limits_its_motor(systems: dict[str, System]) -> None:
    def limit(spec: mujoco.MjSpec) -> None:
        spec.joint("elbow").actfrclimited, spec.joint("elbow").actfrcrange = 1, (-0.5, 0.5)

    system = edited(systems["arm"], limit)
    one = candidate(system, "force_limit", ELBOW)
    [parameter] = one.parameters
    elbow = system.model.joint("elbow").id

    gear = abs(system.model.actuator("elbow").gear[0])
    assert parameter.null == pytest.approx(0.5 / gear)
    for value in (0.2, 2.0):
        found = build(system, [(one, {"limit": value})]).spec.compile()
        np.testing.assert_allclose(found.jnt_actfrcrange[elbow], [-value * gear, value * gear])


def test_a_motor_without_a_limit_may_have_one(systems: dict[str, System]) -> None:
    def unlimit(spec: mujoco.MjSpec) -> None:
        spec.actuator("elbow").forcelimited = 0

    system = edited(systems["arm"], unlimit)
    [p] = candidate(system, "force_limit", ELBOW).parameters

    null = with_cause(system, "force_limit", ELBOW, limit=0.99 * p.null)
    np.testing.assert_allclose(null, predict(system), atol=1e-9)
    expected = predict(edited(system, lambda spec: set_limit(spec, 1.0)))
    found = with_cause(system, "force_limit", ELBOW, limit=1.0)
    np.testing.assert_allclose(found, expected, atol=1e-3)


def set_limit(spec: mujoco.MjSpec, size: float) -> None:
    spec.actuator("elbow").forcelimited = 1
    spec.actuator("elbow").forcerange = (-size, size)


def test_replays_of_the_same_arm_are_the_same(systems: dict[str, System]) -> None:
    """Hooks of gravity compensation write into a copy of the model."""
    system = systems["arm"]
    one = candidate(system, "gravity_compensation", MOTORS)
    first, again = (predict(system, (one, {"share": 0.5})) for _ in range(2))

    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize(("speed", "low", "high"), [(1.0, -2.0, 1.4), (-1.0, -1.4, 2.0)])
def test_a_motor_that_brakes_has_its_whole_force(
    systems: dict[str, System], speed: float, low: float, high: float
) -> None:
    system = systems["arm"]
    plant = build(system, [(candidate(system, "torque_speed_curve", ELBOW), {"drop": 0.3})])
    model = plant.spec.compile()
    data = mujoco.MjData(model)
    data.joint("elbow").qvel = speed
    plant.effects.hooks[0].make(model)(model, data)

    np.testing.assert_allclose(model.actuator("elbow").forcerange, [low, high])


def test_the_speed_of_a_servo_may_have_another_source(systems: dict[str, System]) -> None:
    """As with a tachometer, or a damping that is the motor's own."""

    def damped(*names: str) -> System:
        def damp(spec: mujoco.MjSpec) -> None:
            for name in BOTH:
                spec.actuator(name).biasprm[2] = -2.0 * (name in names)

        return edited(systems["arm"], damp)

    system, at = damped("shoulder"), Location("joint", ("shoulder",))
    only = replace(at, note=POSITION)
    own, positions = (
        build(system, [(candidate(system, "encoder_scale", one), {"scale": 0.2})]).spec.compile()
        for one in (at, only)
    )

    gain = system.model.actuator("shoulder").biasprm[1]
    assert own.actuator("shoulder").biasprm[1:3] == pytest.approx([1.2 * gain, -2.4])
    assert positions.actuator("shoulder").biasprm[1:3] == pytest.approx([1.2 * gain, -2.0])
    assert only not in CATALOGUE["encoder_scale"].locations(damped("elbow"))


def test_a_speed_that_has_another_source_is_read_rightly(systems: dict[str, System]) -> None:
    """Without damping by the servo, the motion is the same whatever speed it reads."""
    system = edited(systems["arm"], scale_gain("elbow", kd=0.0))
    own, positions = (
        with_cause(system, "encoder_scale", replace(AT_ELBOW, note=note), scale=0.1)
        for note in ("", POSITION)
    )
    names = [channel.sensor for channel in system.study.channels]
    velocity = measured(system.study).channel == names.index("velocity_elbow")

    assert np.abs(own - positions)[velocity].max() > 1.0
    np.testing.assert_array_equal(own[~velocity], positions[~velocity])
