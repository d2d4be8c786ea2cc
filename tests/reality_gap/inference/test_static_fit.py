"""Static fit and diagnosis by groups, on an arm whose model is wrong everywhere."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE, find_cause
from reality_gap.inference.group_fit import fit_groups, power
from reality_gap.inference.groups import find_groups, noise_at_rest, positions_at
from reality_gap.inference.static_fit import ROUNDS, StaticFit, fit_at_rest
from reality_gap.inference.verdict import Options
from reality_gap.pipeline import diagnose
from reality_gap.report.extended_model import load_extended
from reality_gap.report.files import write_diagnosis
from reality_gap.simulation.hypothesis import Candidate, Part, build
from reality_gap.simulation.replay import replay
from reality_gap.simulation.replayer import Replayer
from reality_gap.simulation.statics import Statics
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.study.measurements import channel_noise, measured
from reality_gap.study.static_poses import Moments, find_moments
from reality_gap.study.system import System, compile_system

TENDONS = ("front", "back", "upper", "lower")
ARM = """
<mujoco>
  <option timestep="0.004" integrator="implicitfast"/>
  <worldbody>
    <site name="front_0" pos="0.1 0 0.1"/> <site name="back_0" pos="-0.1 0 0.1"/>
    <body name="boom">
      <joint name="shoulder" axis="0 1 0" damping="2"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>
      <site name="front_1" pos="0.08 0 -0.1"/> <site name="back_1" pos="-0.08 0 -0.1"/>
      <site name="upper_0" pos="0.1 0 -0.2"/> <site name="lower_0" pos="-0.1 0 -0.2"/>
      <body name="jib" pos="0 0 -0.3">
        <joint name="elbow" axis="0 1 0" damping="1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.015" mass="0.5"/>
        <site name="upper_1" pos="0.08 0 -0.1"/> <site name="lower_1" pos="-0.08 0 -0.1"/>
        <site name="tip" pos="0 0 -0.25"/>
      </body>
    </body>
  </worldbody>
  <tendon>{tendons}</tendon>
  <actuator>{actuators}</actuator>
  <sensor>{sensors}<framepos name="tip" objtype="site" objname="tip"/></sensor>
</mujoco>
"""
TENDON = '<spatial name="{w}"><site site="{w}_0"/><site site="{w}_1"/></spatial>'
MOTOR = """
<general name="{w}" tendon="{w}" gainprm="20000" biastype="affine" biasprm="-20 -20000 0"
         forcelimited="true" forcerange="-600 -20"/>
"""
SENSORS = """
<tendonpos name="length_{w}" tendon="{w}"/> <actuatorfrc name="tension_{w}" actuator="{w}"/>
"""
PERIOD = 0.02
ZERO = {"shoulder": 0.12, "elbow": -0.09}


def _model(tendons: tuple[str, ...]) -> str:
    parts = [("tendons", TENDON), ("actuators", MOTOR), ("sensors", SENSORS)]
    return ARM.format(**{name: "".join(p.format(w=w) for w in tendons) for name, p in parts})


def _commands(model: mujoco.MjModel, hold: float) -> np.ndarray:
    """Return tendon lengths (n, nu) for moves of 0.5 s between postures and ``hold`` s of rest."""
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(3), []
    for posture in rng.uniform(-0.4, 0.4, (12, 2)):
        data.qpos[:] = posture
        mujoco.mj_fwdPosition(model, data)
        rows.append(data.ten_length - 0.002)
    parts = [np.tile(rows[0], (50, 1))]
    for before, after in pairwise(rows):
        share = np.linspace(0.0, 1.0, 26)[1:, None]
        parts += [before + share * (after - before), np.tile(after, (round(hold / PERIOD), 1))]
    return np.concatenate(parts)


def _study(folder: Path, hold: float = 1.2) -> Study:
    """Return a study without measurements: all readings are zero."""
    path = folder / "arm.xml"
    path.write_text(_model(TENDONS))
    model = mujoco.MjModel.from_xml_path(str(path))
    command = _commands(model, hold)
    time = PERIOD * np.arange(len(command), dtype=np.float64)
    channels = [Channel(f"length_{w}", f"length_{w}", 0, "m", 1e-4) for w in TENDONS]
    channels += [Channel(f"tension_{w}", f"tension_{w}", 0, "N", 0.5) for w in TENDONS]
    channels += [Channel(f"tip_{a}", "tip", i, "m", 2e-4) for i, a in enumerate("xyz")]
    readings = tuple(Reading(time, np.zeros(len(time))) for _ in channels)
    return Study(
        "arm", path, tuple(channels), (Episode("only", time, command, readings),), Initial()
    )


def _group(system: System, name: str) -> Candidate:
    location = next(p for p in find_cause(name).locations(system) if p.note.startswith("every"))
    return Candidate(find_cause(name), location, find_cause(name).parameters(system, location))


def _planted(system: System) -> list[Part]:
    zero, shift = _group(system, "joint_offset"), _group(system, "attachment_shift")
    rng = np.random.default_rng(5)
    moved = {
        p.name: 0.0 if p.name.endswith("y") else rng.normal(0, 0.006) for p in shift.parameters
    }
    return [(zero, dict(ZERO)), (shift, moved)]


def _measure(study: Study, planted: bool = True) -> Study:
    """Return the study with the readings of the actual machine, with noise."""
    system = compile_system(study)
    plant = build(system, _planted(system) if planted else [])
    found = replay(plant, study, measured(study)).prediction
    rng, episode = np.random.default_rng(1), study.episodes[0]
    columns = found.reshape(len(study.channels), -1)
    readings = tuple(
        Reading(r.time, column + rng.normal(0, c.noise or 0.0, len(column)))
        for r, column, c in zip(episode.readings, columns, study.channels, strict=True)
    )
    return replace(study, episodes=(replace(episode, readings=readings),))


@pytest.fixture(scope="module")
def replayer(tmp_path_factory: pytest.TempPathFactory) -> Replayer:
    """Return the replayer of an arm that differs from its model by two groups of causes."""
    return Replayer(_measure(_study(tmp_path_factory.mktemp("arm"))))


def _candidates(system: System) -> list[Part]:
    groups = (_group(system, "joint_offset"), _group(system, "attachment_shift"))
    return [(group, group.null_values()) for group in groups]


def _fit(replayer: Replayer, moments: Moments, start: list[Part] | None = None) -> StaticFit:
    system, statics = replayer.system, Statics(replayer.system, moments)
    qpos = positions_at(moments, replayer.replay([]))
    noise = noise_at_rest(system, statics, channel_noise(system.study), qpos)
    return fit_at_rest(system, statics, start or _candidates(system), qpos, noise)


@pytest.fixture(scope="module")
def found(replayer: Replayer) -> StaticFit:
    """Return the fit of both groups."""
    return _fit(replayer, find_moments(replayer.system.study))


def test_bristles_hold_nothing_at_rest(replayer: Replayer) -> None:
    """Friction adds actuators without input, which an extended model has, too."""
    moments = find_moments(replayer.system.study)
    statics, qpos = Statics(replayer.system, moments), positions_at(moments, replayer.replay([]))
    smooth, rubbing = build(replayer.system, []), replayer.plant([])
    assert rubbing.spec.compile().nactuator > smooth.spec.compile().nactuator
    with_friction = statics.balance(rubbing, qpos)
    for name, expected in vars(statics.balance(smooth, qpos)).items():
        np.testing.assert_allclose(getattr(with_friction, name), expected, rtol=1e-9, atol=1e-9)


def test_finds_the_zero_of_each_joint(found: StaticFit) -> None:
    (_, values), sizes = found.hypothesis[0], found.deviation[0]
    assert values == pytest.approx(ZERO, abs=0.02)
    for joint, zero in ZERO.items():
        assert abs(values[joint] - zero) < 4 * sizes[joint]
        assert sizes[joint] < 0.05


def test_finds_the_paths_of_the_tendons(replayer: Replayer, found: StaticFit) -> None:
    """Lengths change as they should between postures; sites are not determined one by one."""

    def lengths(parts: list[Part]) -> np.ndarray:
        model = build(replayer.system, parts).spec.compile()
        data, rows = mujoco.MjData(model), []
        for posture in np.random.default_rng(0).uniform(-0.4, 0.4, (30, 2)):
            data.qpos[:] = posture
            mujoco.mj_fwdPosition(model, data)
            rows.append(data.ten_length.copy())
        return np.array(rows) - np.mean(rows, axis=0)

    truth = lengths(_planted(replayer.system))
    assert np.std(lengths(found.hypothesis) - truth) < 0.5 * np.std(lengths([]) - truth)


def test_finds_where_joints_stood(replayer: Replayer, found: StaticFit) -> None:
    moments = find_moments(replayer.system.study)
    truth = positions_at(moments, replayer.replay(_planted(replayer.system)))
    before = positions_at(moments, replayer.replay([]))
    assert np.std(found.qpos - truth) < 0.2 * np.std(before - truth)


def test_a_parameter_at_its_bound_does_not_stop_the_others(replayer: Replayer) -> None:
    """With bounds at a sixth of the actual shifts, fits from two starts agree."""
    moments, (zero, (shift, _)) = find_moments(replayer.system.study), _candidates(replayer.system)
    narrow = tuple(replace(p, low=-0.001, high=0.001) for p in shift.parameters)
    shift = replace(shift, parameters=narrow)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (2, len(narrow)))
    ends = []
    for row in signs:
        start = {p.name: 0.001 * sign for p, sign in zip(narrow, row, strict=True)}
        found = _fit(replayer, moments, [zero, (shift, start)])
        assert len(found.cost) < ROUNDS
        ends.append(found.cost[-1])
    assert ends[0] == pytest.approx(ends[1], rel=1e-5)


def test_the_cost_falls(found: StaticFit) -> None:
    assert np.all(np.diff(found.cost) <= 0)
    assert found.cost[-1] < 0.05 * found.cost[0]


def test_the_whole_log_is_explained(replayer: Replayer) -> None:
    messages: list[str] = []
    null = replayer.residual([])
    groups = fit_groups(replayer, list(CATALOGUE.values()), null, 5.0, messages.append)
    assert groups is not None
    assert groups.power < 0.1 * power(replayer.measured, null)
    named = {c.candidate.cause.id: c for c in groups.causes}
    assert named["joint_offset"].confidence > 0.9
    assert named["joint_offset"].candidate.location.elements == ("shoulder", "elbow")
    low, high = (getattr(named["joint_offset"].parameters["shoulder"], e) for e in ("low", "high"))
    assert low < ZERO["shoulder"] < high
    assert len(named["length_offset"].parameters) == len(TENDONS)
    assert messages


def test_groups_survive_their_files(
    replayer: Replayer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The files of a diagnosis by groups replay as the diagnosed hypothesis does."""
    monkeypatch.setattr("reality_gap.report.files.write_report", lambda *_: None)
    study, null = replayer.system.study, replayer.residual([])
    groups = fit_groups(replayer, list(CATALOGUE.values()), null, 5.0)
    assert groups is not None
    options = Options(many=5.0, search_after_groups=False)
    write_diagnosis(diagnose(study, options=options), study, tmp_path / "out")

    replayed = load_extended(tmp_path / "out").replay(study).prediction

    expected = replayer.replay(groups.hypothesis).prediction
    assert np.max(np.abs(replayed - expected) / replayer.measured.noise) < 0.2
    without = replayer.replay([]).prediction
    assert np.max(np.abs(without - expected) / replayer.measured.noise) > 20.0


def test_a_small_gap_is_left_to_the_search(replayer: Replayer) -> None:
    small = np.full(len(replayer.measured.value), 4.0)
    assert fit_groups(replayer, list(CATALOGUE.values()), small, 5.0) is None


def test_no_fit_without_rests(tmp_path: Path) -> None:
    replayer = Replayer(_measure(_study(tmp_path, hold=0.3)))
    null = replayer.residual([])
    assert power(replayer.measured, null) > 25
    assert fit_groups(replayer, list(CATALOGUE.values()), null, 5.0) is None


def test_a_machine_with_few_parts_has_no_groups(replayer: Replayer) -> None:
    assert len(find_groups(replayer.system, list(CATALOGUE.values()))) == 4
    assert (
        find_groups(replayer.system, [find_cause("joint_offset"), find_cause("length_offset")])
        == ()
    )
