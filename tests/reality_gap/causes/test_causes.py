"""The catalogue of causes, on an elbow of three wires and on a screw with a position servo."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE, cause, register
from reality_gap.causes.backlash import played
from reality_gap.causes.base import Cause, Effects, Record
from reality_gap.causes.load_dependent_friction import total_bend
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import replay
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import System, look_at
from reality_gap.types import Floats

IDS = (
    "tendon_elasticity",
    "wire_elongation",
    "coulomb_friction",
    "viscous_friction",
    "load_dependent_friction",
    "direction_dependent_friction",
    "backlash",
    "slack",
    "actuator_lag",
    "delay",
    "force_scale",
    "attachment_shift",
    "missing_wrapping",
    "force_offset",
    "length_offset",
    "length_scale",
    "tension_offset",
    "tension_scale",
    "link_mass",
    "centre_of_mass",
    "payload",
    "joint_stiffness",
    "joint_offset",
    "gravity_direction",
    "external_force",
    "marker_offset",
    "camera_mounting",
    "camera_focal",
)

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


def sensed(model: mujoco.MjModel) -> tuple[Channel, ...]:
    """A channel for every component of every sensor, with its noise."""
    noise = {"t": 1.0, "f": 1.0, "p": 0.5}
    return tuple(
        Channel(
            f"{model.sensor(s).name}_{i}",
            model.sensor(s).name,
            i,
            noise=noise.get(model.sensor(s).name[0], 1e-4),
        )
        for s in range(model.nsensor)
        for i in range(int(model.sensor(s).dim[0]))
    )


def silent(channels: tuple[Channel, ...], duration: float) -> tuple[Reading, ...]:
    """Readings whose values do not matter."""
    time = np.arange(0.0, duration, 0.01)
    return tuple(Reading(time, np.zeros(len(time))) for _ in channels)


@pytest.fixture(scope="module")
def systems(tmp_path_factory: pytest.TempPathFactory) -> dict[str, System]:
    folder = tmp_path_factory.mktemp("studies")
    return {
        "elbow": look_at(elbow_study(folder)),
        "screw": look_at(screw_study(folder)),
        "effort": look_at(screw_study(folder, effort=True)),
    }


def first_of_each_kind(system: System, mechanism: Cause) -> list[Candidate]:
    """One suspect for each kind of place, note, and whether it is a group."""
    found: dict[tuple[str, str, bool], Candidate] = {}
    for location in mechanism.locations(system):
        key = (location.kind, location.note, len(location.elements) > 1)
        found.setdefault(
            key, Candidate(mechanism, location, mechanism.parameters(system, location))
        )
    return list(found.values())


def towards_null(candidate: Candidate, share: float) -> dict[str, float]:
    """A share of each parameter's scale; what has starts, as an event's time, stays at one."""
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
    """What every physics step of the replay saw."""
    study = system.study
    return replay(build(system, list(parts)), study, measured(study)).records


def same(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether two models are identical in every array, and in their options."""
    names = [n for n in dir(one) if isinstance(getattr(one, n), np.ndarray)]
    arrays = all(
        getattr(one, n).shape == getattr(other, n).shape
        and getattr(one, n).tobytes() == getattr(other, n).tobytes()
        for n in names
    )
    return arrays and np.array_equal(one.opt.gravity, other.opt.gravity)


def candidates_of(system: System, id: str) -> list[Candidate]:
    return first_of_each_kind(system, CATALOGUE[id])


def test_the_catalogue_has_every_cause() -> None:
    assert sorted(CATALOGUE) == sorted(IDS)
    assert all(CATALOGUE[id].id == id for id in IDS)


@pytest.mark.parametrize("id", IDS)
def test_a_null_leaves_the_model_identical(systems: dict[str, System], id: str) -> None:
    for system in systems.values():
        null = system.study.spec().compile()
        for candidate in candidates_of(system, id):
            held = towards_null(candidate, 0.0)
            spec, effects = system.study.spec(), Effects()
            if candidate.cause.edit is not None:
                candidate.cause.edit(spec, system, candidate.location, held)
            assert same(spec.compile(), null), str(candidate)
            plant = build(system, [(candidate, candidate.nulls())])
            assert plant.effects == effects, str(candidate)
            assert same(plant.spec.compile(), null), str(candidate)


@pytest.mark.parametrize("id", IDS)
def test_towards_null_the_replay_converges(systems: dict[str, System], id: str) -> None:
    system = systems["elbow"]
    null = predict(system)
    shown = 0.0
    for candidate in candidates_of(system, id):
        far, near, nearer, none = (
            float(np.sqrt(np.mean((predict(system, (candidate, values)) - null) ** 2)))
            for values in (towards_null(candidate, share) for share in (1.0, 0.1, 0.01, 0.0))
        )
        shown = max(shown, far)
        assert near < 0.55 * far + 1e-6, str(candidate)
        assert nearer < 0.55 * near + 1e-6, str(candidate)
        assert none < 1e-6, str(candidate)
    assert shown > 0.05, f"{id} shows in nothing"


@pytest.mark.parametrize("id", IDS)
def test_parameters_are_sound(systems: dict[str, System], id: str) -> None:
    for system in systems.values():
        for location in CATALOGUE[id].locations(system):
            parameters = CATALOGUE[id].parameters(system, location)
            assert len({p.name for p in parameters}) == len(parameters) > 0
            for p in parameters:
                assert p.scale != 0
                assert p.tolerance >= 0
                assert p.low <= p.null <= p.high, f"{id} at {location}: {p}"
                assert p.low <= p.null + p.scale <= p.high, f"{id} at {location}: {p}"
                assert all(p.low <= start <= p.high for start in p.hints.starts)


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
def test_a_servo_obeys_its_law_on_what_its_encoder_reads(
    systems: dict[str, System], id: str
) -> None:
    """Tension = clip(20 N + 20 N/mm (reading - target)), as the machine's own log would show."""
    study = systems["elbow"].study
    first = study.episodes[0]
    held = dataclasses.replace(first, command=np.tile(first.command[30], (len(first.time), 1)))
    system = look_at(dataclasses.replace(study, episodes=(held,)))
    names = [channel.name for channel in study.channels]
    for candidate in candidates_of(system, id):
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
def test_no_episode_sees_what_a_hook_wrote_in_another(systems: dict[str, System], id: str) -> None:
    system = systems["elbow"]
    alone = look_at(dataclasses.replace(system.study, episodes=system.study.episodes[1:]))
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
    by_hand = look_at(dataclasses.replace(system.study, episodes=tuple(late)))
    delayed = records(system, (candidate, {"delay": 0.006}))
    for one, other in zip(delayed, records(by_hand), strict=True):
        rows = min(len(one.time), len(other.time)) - 5
        np.testing.assert_allclose(one.sensors[:rows], other.sensors[:rows], rtol=0, atol=1e-5)


def test_a_delay_is_continuous_where_mujoco_takes_over(systems: dict[str, System]) -> None:
    system = systems["elbow"]
    candidate = candidates_of(system, "delay")[0]
    below, above = (predict(system, (candidate, {"delay": d})) for d in (0.00199999, 0.00200001))
    assert below == pytest.approx(above, abs=0.01)


def test_a_wire_that_gave_stays_longer_in_later_episodes(systems: dict[str, System]) -> None:
    system = systems["elbow"]
    candidate = candidates_of(system, "wire_elongation")[0]
    values = {"elongation": 0.002, "time": 0.7}
    change = np.abs(predict(system, (candidate, values)) - predict(system))
    readings = measured(system.study)
    assert change[(readings.episode == 0) & (readings.time < 0.6)].max() < 0.01
    assert change[(readings.episode == 1) & (readings.time < 0.1)].max() > 1.0


def test_the_effort_of_a_joint_may_have_a_constant_force(systems: dict[str, System]) -> None:
    kinds = {location.kind for location in CATALOGUE["force_offset"].locations(systems["effort"])}
    assert kinds == {"joint"}
    kinds = {location.kind for location in CATALOGUE["force_offset"].locations(systems["elbow"])}
    assert kinds == {"actuator"}


def test_the_bends_of_a_wire_are_its_angle_of_wrap() -> None:
    """Half way around a cylinder, from and to points beside it."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody>
          <geom name="drum" type="cylinder" size="0.1 0.1" contype="0" conaffinity="0"/>
          <site name="a" pos="-1 0.1 0"/><site name="b" pos="-1 -0.1 0"/>
          <site name="side" pos="0.3 0 0"/>
          <body><joint/><geom size="0.01"/></body>
        </worldbody><tendon><spatial name="wire"><site site="a"/>
          <geom geom="drum" sidesite="side"/><site site="b"/></spatial></tendon></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert total_bend(data, 0) == pytest.approx(np.pi, abs=1e-6)


def test_a_wire_does_not_bend_from_one_branch_of_a_pulley_to_the_next() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody>
          <site name="a" pos="0 0 0"/><site name="b" pos="1 0 0"/>
          <site name="c" pos="1 1 0"/><site name="d" pos="1 2 0"/><site name="e" pos="2 2 0"/>
          <body><joint/><geom size="0.01"/></body>
        </worldbody><tendon><spatial name="wire"><site site="a"/><site site="b"/>
          <pulley divisor="2"/><site site="c"/><site site="d"/><site site="e"/>
        </spatial></tendon></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert total_bend(data, 0) == pytest.approx(np.pi / 2, abs=1e-6)


def test_play_moves_only_beyond_its_gap() -> None:
    out = played(np.array([0.0, 0.4, 1.0, 0.6, 0.1, -1.0]), 0.5)
    np.testing.assert_allclose(out, [0.0, 0.0, 0.5, 0.5, 0.5, -0.5])


def test_one_s_own_cause_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("reality_gap.causes.CATALOGUE", dict(CATALOGUE))
    own = dataclasses.replace(CATALOGUE["coulomb_friction"], id="stiction")
    assert register(own) is own
    assert cause("stiction") is own
    with pytest.raises(StudyError, match="'stiction' already"):
        register(own)


def test_an_unknown_cause_is_answered_with_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match=r"'gremlins'.*tendon_elasticity"):
        cause("gremlins")
