"""The replayer on a carriage that a spring drives, exact but for its step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import causes
from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.errors import StudyError
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import replay
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import System, look_at
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
    """Pushed to and fro; not measured yet."""
    path = folder / "carriage.xml"
    path.write_text(CARRIAGE.format(stiffness=stiffness))
    time = np.arange(0.0, seconds, 0.04)
    episode = Episode("only", time, 5 * np.sin(5 * time)[:, None], (Reading(time, 0 * time),))
    channel = Channel("position", "position", unit="m", noise=NOISE)
    return Study("carriage", path, (channel,), (episode,), Initial(settle=0.1))


def exact(study: Study, *parts: tuple[Candidate, dict[str, float]]) -> Floats:
    """What the machine reads without a time step (n,): the limit of ever finer ones."""
    fine = []
    for share in (1 / 64, 1 / 32):
        plant = build(look_at(study), parts)
        plant.spec.option.timestep *= share
        fine.append(replay(plant, study, measured(study)).prediction)
    return 2 * fine[0] - fine[1]


def measure(study: Study, value: Floats) -> Study:
    """The study with these readings (n,)."""
    episode = study.episodes[0]
    reading = Reading(episode.readings[0].time, value)
    return replace(study, episodes=(replace(episode, readings=(reading,)),))


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo writes into the current folder what diverged."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """What the machine reads without a time step and without noise."""
    study = carriage(tmp_path_factory.mktemp("carriage"))
    return measure(study, exact(study))


@pytest.fixture(scope="module")
def replayer(study: Study) -> Replayer:
    return Replayer(study)


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_the_step_error_is_taken_out_of_the_residual(replayer: Replayer) -> None:
    without = (replayer.measured.value - replayer.look([]).prediction) / replayer.measured.noise

    assert rms(without) > 100.0  # many times the noise
    assert rms(replayer.residual([])) < 0.05 * rms(without)


def test_drift_is_what_a_finer_step_would_change(replayer: Replayer, study: Study) -> None:
    expected = study.episodes[0].readings[0].value - replayer.look([]).prediction

    np.testing.assert_allclose(replayer.drift, expected, atol=0.05 * rms(expected))


def test_the_last_halving_hardly_changes_the_drift(replayer: Replayer) -> None:
    assert 0.0 < rms(replayer.drift_error) < 0.05 * rms(replayer.drift)


def test_the_error_of_the_drift_covers_what_is_left(replayer: Replayer) -> None:
    """Of an extrapolation of second order, a halving leaves a quarter: a third of the change."""
    left = rms(replayer.residual([]) * replayer.measured.noise)

    assert left == pytest.approx(rms(replayer.drift_error) / 3, rel=0.3)


def test_at_rest_there_is_no_drift(study: Study) -> None:
    episode = study.episodes[0]
    still = replace(study, episodes=(replace(episode, command=0 * episode.command),))

    np.testing.assert_array_equal(Replayer(still).drift, 0.0)


def push(force: float, name: str = "spring") -> tuple[Candidate, dict[str, float]]:
    """A stiffness of the rail that its drawing does not show, times ``force``."""

    def edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
        spec.joint("rail").stiffness[0] = 40.0 * values["force"]

    parameter = Parameter("force", "1", 1.0, 0.0, -1e9, 1e9, null=1.0)
    cause = Cause(name, "", "", lambda s: (), lambda s, p: (), edit)
    return Candidate(cause, Location("joint", ("rail",)), (parameter,)), {"force": force}


def test_the_step_error_is_taken_out_beside_a_suspect_too(study: Study) -> None:
    """A machine whose spring is a tenth stiffer: only the difference of two step errors is left."""
    replayer = Replayer(measure(study, exact(study, push(1.1))))

    assert rms(replayer.residual([push(1.1)])) < 0.3 * rms(replayer.drift) / NOISE
    assert rms(replayer.residual([push(1.1)])) < 0.03 * rms(replayer.residual([]))


def test_several_hypotheses_are_answered_in_their_order(study: Study) -> None:
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
    """Half of the stiffness that the rail has by then."""
    spec.joint("rail").stiffness[0] *= 0.5


def test_processes_know_the_user_s_own_causes(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They come after the catalogue: a spring is added first, then half of all springs is gone."""
    parameter = Parameter("loose", "1", 1.0, 0.0, 0.0, 1.0)
    rail = Location("joint", ("rail",))
    own = Cause("loose_springs", "", "", nowhere, without_parameters, loosen)
    spring = causes.cause("joint_stiffness")
    added = Candidate(spring, rail, spring.parameters(look_at(study), rail))
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
    spring, rail = causes.cause("joint_stiffness"), Location("joint", ("rail",))
    added = Candidate(spring, rail, spring.parameters(look_at(study), rail))
    hypotheses = [[], [(added, {"stiffness": 30.0, "rest": 0.0})]]
    with Replayer(study, jobs=2) as replayer:
        found = replayer.predictions(other, hypotheses)

    np.testing.assert_array_equal(found, Replayer(study).predictions(other, hypotheses))
    np.testing.assert_array_equal(found[0], Replayer(other).look([]).prediction / NOISE)
    assert rms(found[1] - found[0]) > 1.0


def test_what_diverges_is_nan(replayer: Replayer) -> None:
    assert np.all(np.isnan(replayer.residual([push(1e7)])))


def test_what_does_not_compile_is_named(replayer: Replayer) -> None:
    def edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
        spec.add_actuator(name="motor", trntype=mujoco.mjtTrn.mjTRN_JOINT, target="rail")

    candidate, values = push(2.0, "second motor")
    broken = replace(candidate, cause=replace(candidate.cause, edit=edit))

    with pytest.raises(StudyError, match="the model with second motor at rail does not compile"):
        replayer.look([(broken, values)])


def test_a_slow_machine_may_be_looked_at_coarsely(replayer: Replayer) -> None:
    """Twice the step has twice the error, which is of the size of the drift."""
    change = replayer.look([], coarse=True).prediction - replayer.look([]).prediction

    assert replayer.coarse
    assert rms(change) == pytest.approx(rms(replayer.drift), rel=0.15)


def test_a_machine_that_diverges_at_twice_the_step_may_not(tmp_path: Path) -> None:
    """A spring is followed by steps h while its angular frequency is below 2 / h."""
    stiff = carriage(tmp_path, stiffness=(1.5 / 0.004) ** 2)

    replayer = Replayer(stiff)

    assert np.all(np.isfinite(replayer.residual([])))
    assert not replayer.coarse


def test_efforts_have_no_time_step(tmp_path: Path) -> None:
    """Inverse dynamics along the measured motion: nothing is integrated."""
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
