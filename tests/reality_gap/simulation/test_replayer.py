"""Replayer: a carriage on a spring, whose replay is exact but for the time step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import causes
from reality_gap.causes.base import Cause, Location, Parameter, Record, Values
from reality_gap.errors import StudyError
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import RecordCache, replay
from reality_gap.simulation.replayer import COARSER, Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.study.measurements import channel_noise, measured
from reality_gap.study.system import System, compile_system
from reality_gap.types import Floats

CARRIAGE = """
<mujoco>
  <option timestep="0.004" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="rail" type="slide" axis="1 0 0" damping="2" stiffness="{stiffness}"/>
      <geom type="sphere" size="0.05" mass="1"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="rail"/></actuator>
  <sensor><jointpos name="position" joint="rail"/></sensor>
</mujoco>
"""
NOISE = 1e-6


def carriage(folder: Path, stiffness: float = 40.0, seconds: float = 2.0) -> Study:
    """Return a study of a carriage under a periodic force, without measurements."""
    path = folder / "carriage.xml"
    path.write_text(CARRIAGE.format(stiffness=stiffness))
    time = np.arange(0.0, seconds, 0.04)
    episode = Episode("only", time, 5 * np.sin(5 * time)[:, None], (Reading(time, 0 * time),))
    channel = Channel("position", "position", unit="m", noise=NOISE)
    return Study("carriage", path, (channel,), (episode,), Initial(settle=0.1))


def exact(study: Study, *parts: tuple[Candidate, dict[str, float]]) -> Floats:
    """Return the readings (n,) in the limit of an infinitely small time step."""
    fine = []
    for share in (1 / 64, 1 / 32):
        plant = build(compile_system(study), parts)
        plant.spec.option.timestep *= share
        fine.append(replay(plant, study, measured(study)).prediction)
    return 2 * fine[0] - fine[1]


def measure(study: Study, value: Floats) -> Study:
    """Return the study with these readings (n,)."""
    episode = study.episodes[0]
    reading = Reading(episode.readings[0].time, value)
    return replace(study, episodes=(replace(episode, readings=(reading,)),))


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Change the current folder, to which MuJoCo writes a log if a simulation diverges."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module", autouse=True)
def never_refined() -> Iterator[None]:
    """Keep the step of the model, whose error is 900 times this noise."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("reality_gap.simulation.replayer.TOO_COARSE", np.inf)
        yield


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Return a study with exact readings without noise."""
    study = carriage(tmp_path_factory.mktemp("carriage"))
    return measure(study, exact(study))


@pytest.fixture(scope="module")
def replayer(study: Study) -> Replayer:
    return Replayer(study)


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_the_step_error_is_subtracted_from_the_residual(replayer: Replayer) -> None:
    without = (replayer.measured.value - replayer.replay([]).prediction) / replayer.measured.noise

    assert rms(without) > 100.0  # many times the noise
    assert rms(replayer.residual([])) < 0.05 * rms(without)


def test_drift_is_what_a_finer_step_would_change(replayer: Replayer, study: Study) -> None:
    expected = study.episodes[0].readings[0].value - replayer.replay([]).prediction

    np.testing.assert_allclose(replayer.drift, expected, atol=0.05 * rms(expected))


def test_the_last_halving_hardly_changes_the_drift(replayer: Replayer) -> None:
    assert 0.0 < rms(replayer.drift_error) < 0.05 * rms(replayer.drift)


def test_the_error_of_the_drift_covers_what_is_left(replayer: Replayer) -> None:
    """A halving leaves a quarter of an error of second order, which is a third of its change."""
    left = rms(replayer.residual([]) * replayer.measured.noise)

    assert left == pytest.approx(rms(replayer.drift_error) / 3, rel=0.3)


def test_the_drift_and_its_curvature_give_the_replay_at_half_the_step(
    replayer: Replayer, study: Study, tmp_path: Path
) -> None:
    spec = study.spec()
    spec.option.timestep *= 0.5
    path = tmp_path / "half.xml"
    path.write_text(spec.to_xml(), encoding="utf-8")
    half = Replayer(replace(study, model=path)).replay([]).prediction

    found = replayer.replay([]).prediction + 0.5 * replayer.drift - replayer.drift_curvature

    np.testing.assert_allclose(found, half, atol=1e-3 * rms(replayer.drift))
    assert rms(replayer.drift_curvature) > 1e-3 * rms(replayer.drift)


def test_at_rest_there_is_no_drift(study: Study) -> None:
    episode = study.episodes[0]
    still = replace(study, episodes=(replace(episode, command=0 * episode.command),))

    np.testing.assert_array_equal(Replayer(still).drift, 0.0)


SERVO = """<mujoco><option timestep="0.002"/><worldbody><body><joint name="axle" axis="0 1 0"/>
<geom type="capsule" size="0.05" fromto="0 0 0 0.6 0 0" mass="5"/></body></worldbody>
<actuator><position name="servo" joint="axle" kp="5000" kv="300"/></actuator>
<sensor><jointpos name="angle" joint="axle"/><actuatorfrc name="torque" actuator="servo"/></sensor>
</mujoco>"""


def test_the_step_is_refined_as_long_as_readings_change(tmp_path: Path) -> None:
    """A stiff servo multiplies errors of positions, and commands that jump make them rough."""
    path = tmp_path / "servo.xml"
    path.write_text(SERVO)
    time = np.arange(0.0, 3.0, 0.0041)
    command, late = 0.8 * np.sin(3.0 * time)[:, None], time[:-1] + 0.0019
    readings = tuple(Reading(late, 0.0 * late) for _ in range(2))
    channels = (
        Channel("angle", "angle", unit="rad", noise=1e-4),
        Channel("torque", "torque", unit="N m", noise=0.1),
    )
    study = Study("servo", path, channels, (Episode("only", time, command, readings),))
    replayer = Replayer(study)
    limit = exact(study) - replayer.replay([]).prediction

    torque = replayer.measured.channel == 1
    assert rms(limit[torque]) > 10.0 * 0.1
    assert rms((replayer.drift - limit)[torque]) < 0.1


def push(force: float, name: str = "spring") -> tuple[Candidate, dict[str, float]]:
    """Return a candidate that multiplies the nominal stiffness of the rail by ``force``."""

    def edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
        spec.joint("rail").stiffness[0] = 40.0 * values["force"]

    parameter = Parameter("force", "1", 1.0, 0.0, -1e9, 1e9, null=1.0)
    cause = Cause(name, "", "", lambda s: (), lambda s, p: (), edit)
    return Candidate(cause, Location("joint", ("rail",)), (parameter,)), {"force": force}


def test_the_step_error_is_subtracted_beside_a_candidate_too(study: Study) -> None:
    """With a spring that is a tenth stiffer, only the difference of two step errors is left."""
    replayer = Replayer(measure(study, exact(study, push(1.1))))

    assert rms(replayer.residual([push(1.1)])) < 0.3 * rms(replayer.drift) / NOISE
    assert rms(replayer.residual([push(1.1)])) < 0.03 * rms(replayer.residual([]))


def test_residuals_have_the_order_of_their_hypotheses(study: Study) -> None:
    ticks: list[int] = []
    replayer = Replayer(study, tick=lambda: ticks.append(1))
    hypotheses = [[push(1.2)], [], [push(0.9)]]

    found = replayer.residuals(hypotheses)

    for residual, hypothesis in zip(found, hypotheses, strict=True):
        np.testing.assert_array_equal(residual, Replayer(study).residual(hypothesis))
    assert len(ticks) == 3


def nowhere(system: System) -> tuple[Location, ...]:
    return ()


def without_parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return ()


def loosen(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    """Halve the stiffness that the rail has so far."""
    spec.joint("rail").stiffness[0] *= 0.5


def test_processes_know_the_user_s_own_causes(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They act after the catalogue: a spring is added first, then all stiffness is halved."""
    parameter = Parameter("loose", "1", 1.0, 0.0, 0.0, 1.0)
    rail = Location("joint", ("rail",))
    own = Cause("loose_springs", "", "", nowhere, without_parameters, loosen)
    spring = causes.find_cause("joint_stiffness")
    added = Candidate(spring, rail, spring.parameters(compile_system(study), rail))
    hypothesis = [
        (Candidate(own, rail, (parameter,)), {"loose": 1.0}),
        (added, {"stiffness": 30.0, "rest": 0.0}),
    ]
    monkeypatch.setitem(causes.CATALOGUE, own.id, own)
    alone = Replayer(study)

    with Replayer(study, jobs=2) as replayer:
        found = replayer.residuals([hypothesis, []])

    np.testing.assert_array_equal(found[0], alone.residual(hypothesis))
    np.testing.assert_array_equal(found[0], alone.residual([push(70.0 / 2 / 40.0)]))


def test_another_study_of_the_machine_is_predicted_alike_by_processes(
    study: Study, tmp_path: Path
) -> None:
    other = carriage(tmp_path, seconds=1.0)
    spring, rail = causes.find_cause("joint_stiffness"), Location("joint", ("rail",))
    added = Candidate(spring, rail, spring.parameters(compile_system(study), rail))
    hypotheses = [[], [(added, {"stiffness": 30.0, "rest": 0.0})]]
    with Replayer(study, jobs=2) as replayer:
        found = replayer.predictions(other, hypotheses)

    np.testing.assert_array_equal(found, Replayer(study).predictions(other, hypotheses))
    own = Replayer(study)
    predicted = Replayer(other).replay([], step=COARSER if own.coarse else 1.0).prediction
    np.testing.assert_array_equal(found[0], predicted / NOISE)
    assert rms(found[1] - found[0]) > 1.0


@pytest.mark.parametrize("own", [True, False])
def test_what_diverges_writes_no_log_and_leaves_the_handler_of_the_caller(
    study: Study, tmp_path: Path, own: bool
) -> None:
    """MuJoCo writes MUJOCO_LOG.TXT into the current folder unless warnings have a handler."""
    warnings = list[str]()
    before, handler = mujoco.get_mju_user_warning(), warnings.append if own else None
    mujoco.set_mju_user_warning(handler)
    try:
        with Replayer(study) as outer:
            with Replayer(study) as inner:
                assert np.all(np.isnan(inner.residual([push(1e7)])))
            assert np.all(np.isnan(outer.residual([push(1e7)])))
        after = mujoco.get_mju_user_warning()
    finally:
        mujoco.set_mju_user_warning(before)
    assert after == handler
    assert warnings == []
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_what_diverges_is_nan(replayer: Replayer) -> None:
    assert np.all(np.isnan(replayer.residual([push(1e7)])))


def test_what_does_not_compile_is_named(replayer: Replayer) -> None:
    def edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
        spec.add_actuator(name="motor", trntype=mujoco.mjtTrn.mjTRN_JOINT, target="rail")

    candidate, values = push(2.0, "second motor")
    broken = replace(candidate, cause=replace(candidate.cause, edit=edit))

    with pytest.raises(StudyError, match="the model with second motor at rail does not compile"):
        replayer.replay([(broken, values)])


def test_a_slow_machine_may_be_replayed_coarsely(replayer: Replayer) -> None:
    """Twice the step has twice the error, so that the change is as large as the drift."""
    change = replayer.replay([], step=COARSER).prediction - replayer.replay([]).prediction

    assert replayer.coarse
    assert rms(change) == pytest.approx(rms(replayer.drift), rel=0.15)


@pytest.mark.parametrize("step", [0.25, 2.0])
def test_a_delay_within_a_step_is_as_long_at_other_steps(tmp_path: Path, step: float) -> None:
    """Causes know the step of the replay: 3 ms are less than one step of 4 ms and three of 1 ms."""
    study = carriage(tmp_path)
    replayer = Replayer(study)
    delay, motor = causes.find_cause("delay"), Location("actuator", ("motor",))
    candidate = Candidate(delay, motor, delay.parameters(replayer.system, motor))

    def change(step: float) -> Floats:
        late = replayer.replay([(candidate, {"delay": 0.003})], step).prediction
        return late - replayer.replay([], step).prediction

    assert rms(change(1.0)) > 1e-6
    np.testing.assert_allclose(change(step), change(1.0), atol=0.1 * rms(change(1.0)))


def test_a_machine_that_diverges_at_twice_the_step_may_not(tmp_path: Path) -> None:
    """The integration of a spring is stable while its angular frequency is below 2 / h."""
    stiff = carriage(tmp_path, stiffness=(1.5 / 0.004) ** 2)

    replayer = Replayer(stiff)

    assert np.all(np.isfinite(replayer.residual([])))
    assert not replayer.coarse


def test_efforts_have_no_time_step(tmp_path: Path) -> None:
    """Inverse dynamics follow the measured motion, so that there is no integration."""
    study = carriage(tmp_path, seconds=20.0)
    episode = study.episodes[0]
    effort = Channel("effort", "rail", unit="N", noise=1.0, kind="effort")
    readings = (
        Reading(episode.time, np.sin(5 * episode.time)),
        Reading(episode.time, 3 * np.cos(5 * episode.time)),
    )
    efforts = replace(
        study,
        channels=(*study.channels, effort),
        episodes=(replace(episode, readings=readings),),
    )

    replayer = Replayer(efforts)

    assert not replayer.coarse
    np.testing.assert_array_equal(replayer.drift, 0.0)
    np.testing.assert_array_equal(replayer.drift_error, 0.0)


def test_a_cache_counts_all_signals_and_the_model() -> None:
    model = mujoco.MjModel.from_xml_string(CARRIAGE.format(stiffness=40.0))
    few, many = np.zeros((9, 1)), np.zeros((100_000, 1))
    made = []

    def make() -> Record:
        made.append(1)
        return Record(few[:, 0], few, few, few, few, many, few, model)

    cache = RecordCache(1.5 * (many.nbytes + model.nbuffer))
    for key in ("one", "two", "two", "one"):
        cache.get(key, make)
    assert len(made) == 3


@pytest.mark.parametrize("wrong", [40.0, 50.0])
def test_noise_is_estimated_from_the_errors_of_the_model(tmp_path: Path, wrong: float) -> None:
    """In readings at 25 Hz, the motion of 0.8 Hz itself looks like a noise of a millimetre."""
    noise, study = 1e-5, carriage(tmp_path, seconds=20.0)
    values = exact(study) + noise * np.random.default_rng(0).standard_normal(500)
    silent = replace(study, channels=(replace(study.channels[0], noise=None),))
    assert channel_noise(measure(silent, values))[0] > 10.0 * noise
    (tmp_path / "carriage.xml").write_text(CARRIAGE.format(stiffness=wrong))

    found = Replayer(measure(silent, values)).system.study.channels[0].noise

    # A model that is wrong explains less of the motion, but never makes the noise larger.
    assert found == pytest.approx(noise, rel=0.2) if wrong == 40.0 else found > 0.8 * noise
    assert found <= channel_noise(measure(silent, values))[0]


def test_a_stated_noise_is_not_estimated(tmp_path: Path) -> None:
    study = carriage(tmp_path)

    assert Replayer(measure(study, exact(study))).system.study.channels == study.channels
