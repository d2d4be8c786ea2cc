"""Scales of causes follow the size of the machine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE, find_cause
from reality_gap.causes.base import Location, Parameter
from reality_gap.causes.support import machine_size
from reality_gap.causes.support.typical_scales import joint_force, joint_uses, tendon_force
from reality_gap.study.data import Channel, Episode, Reading
from reality_gap.study.system import System, compile_system
from reality_gap.types import Floats
from tests.reality_gap.causes.plants import system_of

ARM = """
<mujoco>
  <option timestep="0.001" {option}/>
  <worldbody>
    <camera name="eye" pos="0 {far} 0"/>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" range="-90 90" limited="true"/>
      <geom type="capsule" size="{thin}" fromto="0 0 0 {long} 0 0" mass="{mass}"/>
      <site name="tip" pos="{long} 0 0"/>
    </body>
  </worldbody>
  <actuator>{motor}</actuator>
  <sensor><framepos name="seen" objtype="site" objname="tip" reftype="camera" refname="eye"/>
  </sensor>
</mujoco>
"""
CABLE = """
<mujoco>
  <worldbody>
    <body>
      <joint name="jaw" axis="0 0 1" range="-60 60" limited="true"/>
      <geom type="capsule" fromto="0 0 0 0.01 0 0" size="0.002" mass="0.001"/>
    </body>
  </worldbody>
  <tendon><fixed name="cable"><joint joint="jaw" coef="-0.005"/></fixed></tendon>
  <actuator><position name="spindle" tendon="cable" kp="2e5"/></actuator>
  <sensor><actuatorfrc name="tension" actuator="spindle"/></sensor>
</mujoco>
"""
LIMITED = '<motor name="motor" joint="shoulder" forcelimited="true" forcerange="-{0} {0}"/>'


def arm(folder: Path, long: float, mass: float, motor: str, option: str = "") -> System:
    """One link with a motor."""
    path = folder / f"arm-{long}-{mass}.xml"
    path.write_text(
        ARM.format(long=long, thin=0.1 * long, far=-2 * long, mass=mass, motor=motor, option=option)
    )
    return system_of(path)


def friction(system: System) -> Parameter:
    cause = find_cause("coulomb_friction")
    return cause.parameters(system, Location("joint", ("shoulder",)))[0]


@pytest.mark.parametrize(("limit", "long", "mass"), [(0.1, 0.06, 0.02), (2500.0, 2.0, 60.0)])
def test_friction_of_a_hundredth_of_the_limit_is_seen(
    tmp_path: Path, limit: float, long: float, mass: float
) -> None:
    found = friction(arm(tmp_path, long, mass, LIMITED.format(limit)))

    assert 0.1 * found.scale < 0.01 * limit < found.high
    assert found.tolerance < 0.001 * limit


def test_where_a_machine_stands_is_no_size_of_it(tmp_path: Path) -> None:
    here = arm(tmp_path, 0.06, 0.02, LIMITED.format(0.1))
    text = here.study.model.read_text().replace('name="upper"', 'name="upper" pos="5 0 1"')
    away = tmp_path / "away.xml"
    away.write_text(text)
    sizes = [machine_size.machine_size(one).link for one in (here, system_of(away))]

    assert sizes[1] == pytest.approx(sizes[0])


def test_a_motor_of_a_joint_in_its_parent_limits_the_load_too(tmp_path: Path) -> None:
    loads = [
        machine_size.machine_size(arm(tmp_path, long, 0.02, motor)).load[0]
        for long, motor in (
            (0.06, LIMITED.format(0.01)),
            (0.0600001, LIMITED.format(0.01).replace("joint=", "jointinparent=")),
        )
    ]

    assert loads[1] == pytest.approx(loads[0], rel=1e-3)


def test_a_limit_that_limits_nothing_is_no_scale(tmp_path: Path) -> None:
    """A motor of 1000 N m on a finger: the load by gravity is 0.006 N m."""
    found = friction(arm(tmp_path, 0.06, 0.02, LIMITED.format(1000.0)))

    assert found.scale < 0.01


def test_without_limits_gravity_is_the_scale(tmp_path: Path) -> None:
    system = arm(tmp_path, 1.0, 4.0, '<motor name="motor" joint="shoulder"/>')
    size = machine_size.machine_size(system)

    assert size.gravity == pytest.approx([0.5 * 4.0 * 9.81], rel=0.05)
    assert size.gravity[0] <= size.load[0] < 3 * size.gravity[0]


def test_without_gravity_inertia_is_the_scale(tmp_path: Path) -> None:
    heavy, light = (
        friction(arm(tmp_path, 1.0, m, '<motor name="motor" joint="shoulder"/>', 'gravity="0 0 0"'))
        for m in (4.0, 0.4)
    )

    assert heavy.scale == pytest.approx(10 * light.scale, rel=1e-3)


PLAIN = '<motor name="motor" joint="shoulder" gear="2"/>'


def with_log(system: System, command: float, channel: Channel | None, value: float) -> System:
    """The system with a log of a constant command and of constant readings of one channel."""
    time = np.linspace(0.0, 1.0, 11)
    readings = () if channel is None else (Reading(time, np.full(11, value)),)
    episode = Episode("log", time, np.full((11, 1), command), readings)
    channels = () if channel is None else (channel,)
    return compile_system(replace(system.study, channels=channels, episodes=(episode,)))


@pytest.mark.parametrize(
    ("command", "sensor", "value"),
    [(0.25, "", 0.0), (0.0, "actuatorfrc", -0.25), (0.0, "jointactuatorfrc", 0.5)],
)
def test_a_light_link_that_carries_a_load_has_the_scale_of_the_load(
    tmp_path: Path, command: float, sensor: str, value: float
) -> None:
    """Gravity on the link is 0.006 N m; the motor was commanded, or shown to exert, 0.5 N m."""
    text = arm(tmp_path, 0.06, 0.02, PLAIN).study.model.read_text()
    at = 'actuator="motor"' if sensor == "actuatorfrc" else 'joint="shoulder"'
    if sensor:
        text = text.replace("<sensor>", f'<sensor><{sensor} name="force" {at}/>')
    path = tmp_path / "loaded.xml"
    path.write_text(text)
    channel = Channel("force", "force", noise=0.01) if sensor else None

    found = friction(with_log(system_of(path), command, channel, value))

    assert found.scale == pytest.approx(0.02 * 0.5, rel=1e-6)
    assert found.high > 0.5


@pytest.mark.parametrize(
    "motor",
    [
        '<general name="motor" joint="shoulder" dyntype="integrator" gainprm="100"/>',
        '<position name="motor" joint="shoulder" kp="100"/>',
    ],
)
def test_a_command_that_is_no_force_is_no_scale(tmp_path: Path, motor: str) -> None:
    system = arm(tmp_path, 0.06, 0.02, motor)

    assert friction(with_log(system, 1.0, None, 0.0)) == friction(system)


def servo_log(
    folder: Path, attributes: str, time: Floats, command: Floats, value: Floats
) -> System:
    """A light link with a servo, and a log of its commands and positions (k,)."""
    servo = f'<position name="motor" joint="shoulder" {attributes}/>'
    text = arm(folder, 0.06, 0.02, servo).study.model.read_text()
    path = folder / "servo.xml"
    path.write_text(text.replace("<sensor>", '<sensor><jointpos name="q" joint="shoulder"/>'))
    study, channels = system_of(path).study, (Channel("q", "q", noise=1e-4),)
    episode = Episode("log", time, command[:, None], (Reading(time, value),))
    return compile_system(replace(study, channels=channels, episodes=(episode,)))


@pytest.mark.parametrize("filtered", ["", 'timeconst="0.01"'])
def test_the_distance_of_a_servo_from_its_command_is_a_force(tmp_path: Path, filtered: str) -> None:
    """It holds a load of 0.8 N m, 0.4 rad from its command; gravity on the link is 0.006 N m."""
    time = np.linspace(0.0, 1.0, 11)
    attributes = f'kp="1" gear="2" kv="0.1" {filtered}'

    found = friction(servo_log(tmp_path, attributes, time, np.ones(11), np.full(11, 0.3)))

    assert found.scale == pytest.approx(0.02 * 2.0 * (1.0 - 2.0 * 0.3), rel=1e-6)
    assert found.high > 2.0 * 0.8


def test_what_a_servo_cannot_reach_and_noise_of_its_speed_are_no_force(tmp_path: Path) -> None:
    """Commands are limited to 0.5 rad, and the speed of a joint that rests is noise."""
    time = np.arange(0.0, 2.0, 0.001)
    value = 0.1 + 1e-4 * np.random.default_rng(0).standard_normal(len(time))
    command = np.where(time < 1.0, 30.0, -30.0)

    found = friction(
        servo_log(tmp_path, 'kp="1" kv="5" ctrlrange="-0.5 0.5"', time, command, value)
    )

    assert found.scale == pytest.approx(0.02 * np.sqrt(0.5 * (0.4**2 + 0.6**2)), rel=0.02)


def test_a_reading_at_a_command_belongs_to_the_command_before(tmp_path: Path) -> None:
    time = np.arange(0.0, 2.0, 0.05)
    command = 0.5 * np.sin(3.0 * time)
    value = np.concatenate([command[:1], command[:-1]]) - 0.005  # it follows within a period

    found = friction(servo_log(tmp_path, 'kp="100" kv="0"', time, command, value))

    assert found.scale == pytest.approx(0.02 * 0.5, rel=0.02)


def test_friction_is_at_most_the_limit_of_a_motor_and_larger_where_none_is_known(
    tmp_path: Path,
) -> None:
    """A gripper that closes on a thing needs many times what its light fingers do."""
    limited = friction(arm(tmp_path, 0.06, 0.02, LIMITED.format(0.005)))
    assert limited.high == pytest.approx(0.005)
    unknown = arm(tmp_path, 0.061, 0.02, PLAIN)
    assert friction(unknown).high > 10.0 * machine_size.machine_size(unknown).gravity[0]


def test_a_log_without_commands_shows_no_forces(tmp_path: Path) -> None:
    system = arm(tmp_path, 0.06, 0.02, PLAIN)
    episode = Episode("log", np.zeros(1), np.zeros((1, 0)), ())
    empty = compile_system(replace(system.study, channels=(), episodes=(episode,)))

    assert friction(empty) == friction(system)


def test_forces_that_a_log_showed_are_known_without_its_readings(tmp_path: Path) -> None:
    path = tmp_path / "cable.xml"
    path.write_text(CABLE)
    system = with_log(system_of(path), 0.0, Channel("tension", "tension", noise=0.1), 40.0)
    bare = replace(system.study.episodes[0], readings=(), command=np.zeros((11, 1)))

    loaded = compile_system(replace(system.study, episodes=(bare,), uses=joint_uses(system)))

    at = Location("tendon", ("cable",))
    assert tendon_force(loaded, at) == pytest.approx(tendon_force(system, at), rel=1e-9)
    assert tendon_force(system, at) == pytest.approx(40.0, rel=1e-6)


@pytest.mark.parametrize("limit", ['forcerange="-1000 1000"', 'ctrlrange="-100 100"'])
def test_a_limit_of_the_motor_of_a_tendon_counts_for_its_joint(tmp_path: Path, limit: str) -> None:
    path = tmp_path / "cable.xml"
    plain = f'<motor name="spindle" tendon="cable" {limit}/>'
    path.write_text(CABLE.replace('<position name="spindle" tendon="cable" kp="2e5"/>', plain))
    system = system_of(path)
    joint = Location("joint", ("jaw",))

    assert joint_force(with_log(system, 1e6, None, 0.0), joint) == joint_force(system, joint)


def test_a_limit_of_a_motor_is_the_scale_whatever_the_log_shows(tmp_path: Path) -> None:
    limited = arm(tmp_path, 0.06, 0.02, LIMITED.format(0.1))

    assert friction(with_log(limited, 0.09, None, 0.0)) == friction(limited)


def test_the_tension_of_a_tendon_is_the_scale_of_its_friction_and_of_its_joint(
    tmp_path: Path,
) -> None:
    path = tmp_path / "cable.xml"
    path.write_text(CABLE)
    tension = Channel("tension", "tension", noise=0.1)

    system = with_log(system_of(path), 0.0, tension, 40.0)
    cause = find_cause("coulomb_friction")
    of_joint = cause.parameters(system, Location("joint", ("jaw",)))[0]
    of_tendon = cause.parameters(system, Location("tendon", ("cable",)))[0]

    assert of_joint.scale == pytest.approx(0.02 * 0.005 * 40.0, rel=1e-6)
    assert of_tendon.scale == pytest.approx(0.03 * 40.0, rel=1e-6)


def test_the_elbow_has_the_scales_that_thresholds_were_set_with(elbow: System) -> None:
    """Documented values: friction of 3 N per tendon at 500 N, 0.2 N m, 2 mm, and others."""
    spec = elbow.study.spec()
    for actuator in spec.actuators:
        actuator.forcelimited, actuator.forcerange = True, np.array([-500.0, -30.0])
    path = elbow.study.model.with_name("limited.xml")
    path.write_text(spec.to_xml())
    system = system_of(path)
    expected = {
        ("coulomb_friction", "tendon"): 3.0,
        ("coulomb_friction", "joint"): 0.2,
        ("viscous_friction", "tendon"): 20.0,
        ("attachment_shift", "site"): 0.0024,
        ("payload", "body"): 0.1,
        ("tendon_elasticity", "tendon"): 3e-6,
        ("length_offset", "tendon"): 0.001,
        ("backlash", "tendon"): 0.0003,
        ("wire_elongation", "tendon"): 0.001,
        ("slack", "tendon"): 0.001,
    }
    for (id, kind), scale in expected.items():
        location = next(p for p in find_cause(id).locations(system) if p.kind == kind)
        found = find_cause(id).parameters(system, location)[0]
        assert found.scale == pytest.approx(scale, rel=0.15), id


NO_SIZE = {"1", "rad", "s", "rad/s", "s/rad"}
"""Units of parameters whose scale does not depend on the size of a machine."""


def test_all_scales_are_those_of_the_machine(tmp_path: Path) -> None:
    """Two machines that differ in nothing but their unit of length, with the same density.

    Lengths are 10 times as large, masses 1000 times and torques 10 000 times.
    """
    small, large = (
        arm(tmp_path, long, mass, LIMITED.format(limit), 'gravity="0 0 -9.81"')
        for long, mass, limit in ((0.1, 0.05, 0.5), (1.0, 50.0, 5000.0))
    )
    powers = {
        "m": 1,
        "m^2": 2,
        "kg": 3,
        "N": 3,
        "N m": 4,
        "N m s/rad": 4,
        "N m/rad": 4,
        "kg m^2": 5,
    }
    powers["rad/(N m)"] = -4
    for cause in CATALOGUE.values():
        for one, other in zip(cause.locations(small), cause.locations(large), strict=True):
            pairs = zip(cause.parameters(small, one), cause.parameters(large, other), strict=True)
            for p, q in pairs:
                if p.unit not in NO_SIZE:
                    expected = 10.0 ** powers[p.unit]
                    assert q.scale / p.scale == pytest.approx(expected, rel=0.02), (cause.id, p)
                    assert q.tolerance == pytest.approx(expected * p.tolerance, rel=0.02)
                    assert q.high == pytest.approx(expected * p.high, rel=0.02)
