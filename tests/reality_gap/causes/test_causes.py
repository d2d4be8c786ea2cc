"""Effects of single causes, on an elbow with three tendons and on a screw with a position servo."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.backlash import played
from reality_gap.causes.base import Location
from reality_gap.causes.load_dependent_friction import total_bend
from reality_gap.causes.support.encoders import READING
from reality_gap.inference.screening import list_candidates
from reality_gap.inference.theta import is_tolerable
from reality_gap.simulation.hypothesis import build
from reality_gap.simulation.replay import replay
from reality_gap.study.data import ReadState
from reality_gap.study.measurements import measured
from reality_gap.study.system import System, compile_system
from tests.reality_gap.causes.machines import TENDONS, candidates_of, predict, records, towards_null


@pytest.mark.parametrize("id", ["backlash", "direction_dependent_friction", "force_scale"])
def test_joints_with_a_servo_have_the_cause_too(systems: dict[str, System], id: str) -> None:
    system = systems["screw"]
    candidate = candidates_of(system, id)[0]
    change = predict(system, (candidate, towards_null(candidate, 1.0))) - predict(system)
    assert np.sqrt(np.mean(change**2)) > 0.05


@pytest.mark.parametrize(
    "id",
    ["tendon_elasticity", "wire_elongation", "backlash", "slack", "length_offset", "length_scale"],
)
def test_a_servo_obeys_its_law_with_the_readings_of_its_encoder(
    systems: dict[str, System], id: str
) -> None:
    """Tension = clip(20 N + 20 N/mm (reading - target)), as in a log of the machine."""
    study = systems["elbow"].study
    first = study.episodes[0]
    held = dataclasses.replace(first, command=np.tile(first.command[30], (len(first.time), 1)))
    system = compile_system(dataclasses.replace(study, episodes=(held,)))
    names = [channel.name for channel in study.channels]
    of_servo = [s for s in candidates_of(system, id) if s.location.note != READING]
    for candidate in of_servo:
        plant = build(system, [(candidate, towards_null(candidate, 1.0))])
        found = replay(plant, system.study, measured(system.study)).prediction
        last = dict(zip(names, found.reshape(len(names), -1)[:, -1], strict=True))
        for i, tendon in enumerate(TENDONS):
            stretch = last[f"length_{tendon}_0"] - held.command[0, i]
            law = np.clip(20 + 20000 * stretch, 20, 400)
            assert -last[f"tension_{tendon}_0"] == pytest.approx(law, abs=0.3), str(candidate)


@pytest.mark.parametrize(
    "id", ["backlash", "slack", "load_dependent_friction", "direction_dependent_friction"]
)
def test_hooks_do_not_affect_other_episodes(systems: dict[str, System], id: str) -> None:
    system = systems["elbow"]
    alone = compile_system(dataclasses.replace(system.study, episodes=system.study.episodes[1:]))
    for candidate in candidates_of(system, id):
        values = towards_null(candidate, 1.0)
        second = predict(alone, (candidate, values))
        both = predict(system, (candidate, values))
        assert both[-len(second) :] == pytest.approx(second, abs=1e-6), str(candidate)


def test_a_delay_of_three_steps_is_the_commands_three_steps_later(
    systems: dict[str, System],
) -> None:
    system = systems["elbow"]
    candidate = candidates_of(system, "delay")[1]
    assert candidate.location.elements == TENDONS
    late = [
        dataclasses.replace(
            episode,
            time=np.concatenate([[0.0], episode.time + 0.006]),
            command=np.concatenate([episode.command[:1], episode.command]),
        )
        for episode in system.study.episodes
    ]
    by_hand = compile_system(dataclasses.replace(system.study, episodes=tuple(late)))
    delayed = records(system, (candidate, {"delay": 0.006}))
    for one, other in zip(delayed, records(by_hand), strict=True):
        rows = min(len(one.time), len(other.time)) - 5
        np.testing.assert_allclose(one.sensors[:rows], other.sensors[:rows], rtol=0, atol=1e-5)


def test_a_delay_is_continuous_where_mujoco_takes_over(systems: dict[str, System]) -> None:
    system = systems["elbow"]
    candidate = candidates_of(system, "delay")[0]
    below, above = (predict(system, (candidate, {"delay": d})) for d in (0.00199999, 0.00200001))
    assert below == pytest.approx(above, abs=0.01)


def test_an_elongated_tendon_stays_longer_in_later_episodes(systems: dict[str, System]) -> None:
    system = systems["elbow"]
    candidate = candidates_of(system, "wire_elongation")[0]
    values = {"elongation": 0.002, "time": 0.7}
    change = np.abs(predict(system, (candidate, values)) - predict(system))
    readings = measured(system.study)
    assert change[(readings.episode == 0) & (readings.time < 0.6)].max() < 0.01
    assert change[(readings.episode == 1) & (readings.time < 0.1)].max() > 1.0


@pytest.mark.parametrize(
    ("id", "values"), [("length_scale", {"scale": 0.05}), ("length_offset", {"offset": 0.002})]
)
def test_lengths_may_be_wrong_in_the_log_alone(
    systems: dict[str, System], id: str, values: dict[str, float]
) -> None:
    """As with another radius of the spool in the program that writes the log than in the servo."""
    system = systems["elbow"]
    listed = list_candidates(system, [CATALOGUE[id]])
    one = Location("tendon", ("biceps",))
    log_only = next(s for s in listed if s.location == dataclasses.replace(one, note=READING))
    servo, readings = next(s for s in listed if s.location == one), measured(system.study)
    names = [channel.sensor for channel in system.study.channels]
    of_length = readings.channel == names.index("length_biceps")

    change = predict(system, (log_only, values)) - predict(system)

    assert np.abs(change[of_length]).max() > 1.0
    assert not change[~of_length].any()
    assert np.abs((predict(system, (servo, values)) - predict(system))[~of_length]).max() > 1.0


def test_the_effort_of_a_joint_may_have_a_constant_force(systems: dict[str, System]) -> None:
    kinds = {location.kind for location in CATALOGUE["force_offset"].locations(systems["effort"])}
    assert kinds == {"joint"}
    kinds = {location.kind for location in CATALOGUE["force_offset"].locations(systems["elbow"])}
    assert kinds == {"actuator"}


def test_a_spring_far_from_its_rest_includes_the_constant_force_of_the_motor_at_its_joint(
    systems: dict[str, System],
) -> None:
    listed = list_candidates(systems["arm"], [CATALOGUE["joint_stiffness"]])
    springs = [one for one in listed if not one.location.note]
    forces = list_candidates(systems["arm"], [CATALOGUE["force_offset"]])
    pairs = {
        (spring.location.elements, force.location.elements)
        for spring in springs
        for force in forces
        if spring.includes(force)
    }
    assert pairs == {(("shoulder",), ("shoulder",)), (("elbow",), ("elbow",))}
    assert not any(force.includes(spring) for spring in springs for force in forces)
    assert not any(spring.location == force.location for spring in springs for force in forces)


def test_the_bends_of_a_tendon_are_its_wrap_angle() -> None:
    """Half way around a cylinder, from and to points beside it."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody>
          <geom name="drum" type="cylinder" size="0.1 0.1" contype="0" conaffinity="0"/>
          <site name="a" pos="-1 0.1 0"/><site name="b" pos="-1 -0.1 0"/>
          <site name="side" pos="0.3 0 0"/>
          <body><joint/><geom size="0.01"/></body>
        </worldbody><tendon><spatial name="rope"><site site="a"/>
          <geom geom="drum" sidesite="side"/><site site="b"/></spatial></tendon></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert total_bend(data, 0) == pytest.approx(np.pi, abs=1e-6)


def test_a_tendon_does_not_bend_between_branches_of_a_pulley() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody>
          <site name="a" pos="0 0 0"/><site name="b" pos="1 0 0"/>
          <site name="c" pos="1 1 0"/><site name="d" pos="1 2 0"/><site name="e" pos="2 2 0"/>
          <body><joint/><geom size="0.01"/></body>
        </worldbody><tendon><spatial name="rope"><site site="a"/><site site="b"/>
          <pulley divisor="2"/><site site="c"/><site site="d"/><site site="e"/>
        </spatial></tendon></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert total_bend(data, 0) == pytest.approx(np.pi / 2, abs=1e-6)


def test_play_moves_only_beyond_its_gap() -> None:
    out = played(np.array([0.0, 0.4, 1.0, 0.6, 0.1, -1.0]), 0.5)
    np.testing.assert_allclose(out, [0.0, 0.0, 0.5, 0.5, 0.5, -0.5])


def test_play_begins_anywhere_in_its_gap() -> None:
    out = played(np.array([0.0, 0.4, 1.0, 1.2, 0.6, 0.1]), 0.5, 0.5)
    np.testing.assert_allclose(out, [0.5, 0.5, 0.5, 0.7, 0.7, 0.6])


@pytest.mark.parametrize("begin", [-0.9, 0.9])
def test_a_servo_feels_where_in_its_gap_an_encoder_begins(
    systems: dict[str, System], begin: float
) -> None:
    """What it reads at the begin of a log is its command, as nearly as without a gap."""
    system = systems["arm"]
    one = next(c for c in candidates_of(system, "backlash") if c.location.elements == ("shoulder",))
    [before] = records(system)
    [after] = records(system, (one, {"gap": 0.1, "begin": begin}))
    joint, read = before.model.joint("shoulder").qposadr[0], before.column("position_shoulder")

    assert after.qpos[0, joint] - before.qpos[0, joint] == pytest.approx(-0.05 * begin, abs=5e-3)
    assert after.sensors[0, read] == pytest.approx(before.sensors[0, read], abs=5e-3)


def test_a_first_reading_is_that_of_an_encoder_in_its_play(systems: dict[str, System]) -> None:
    chosen = candidates_of(systems["arm"], "backlash")
    one = next(c for c in chosen if c.location.elements == ("shoulder",))
    states = {"shoulder": ReadState(0.3, 0.0, 0.0, 0.0), "elbow": ReadState(0.2, 0.0, 0.0, 0.0)}
    for effect in build(systems["arm"], [(one, {"gap": 0.1, "begin": -0.5})]).effects.starts:
        effect(states)

    assert states["shoulder"].position == pytest.approx(0.325)
    assert states["elbow"].position == 0.2


def test_a_clock_that_drifts_by_less_than_a_step_is_a_fault(systems: dict[str, System]) -> None:
    """In a correct model clocks are late by a part of a step, but not later and later."""
    system = systems["elbow"]
    one = candidates_of(system, "clock_drift")[0]
    drift = 0.9 * float(system.model.opt.timestep) / system.duration

    assert drift > 5e-5  # clocks with a quartz differ by less
    assert not is_tolerable(one, {"drift": drift})
    assert is_tolerable(one, {"drift": 2e-5})


def test_each_episode_begins_without_a_drift_of_the_clock(systems: dict[str, System]) -> None:
    system = systems["elbow"]
    one = candidates_of(system, "clock_drift")[0]
    pairs = zip(records(system, (one, {"drift": 0.25})), records(system), strict=True)
    for found, null in pairs:
        since = null.time - null.time[0]
        for sensor in system.sensed:
            column = null.column(sensor, 0)
            expected = np.interp(since / 1.25, since, null.sensors[:, column])
            np.testing.assert_allclose(found.sensors[:, column], expected, atol=1e-9)
