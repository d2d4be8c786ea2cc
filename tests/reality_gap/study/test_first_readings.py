"""State in which a log begins: found from the first readings, whatever the encoder says."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Verdict, diagnose, load_study
from reality_gap.causes import find_cause
from reality_gap.inference.tolerances import tolerance_columns
from reality_gap.inference.verdict import Options
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.simulation.likelier_start import with_likelier_start
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.study.first_readings import read_state
from reality_gap.study.measurements import measured
from reality_gap.types import Floats
from tests.reality_gap.servo_arm import ARM, STUDY

FREQUENCY, AMPLITUDE = 0.6, 0.4


def position(time: Floats) -> Floats:
    return np.asarray(AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * time + 0.7))


def clock(rate: float, jitter: float, rng: np.random.Generator) -> Floats:
    """Two seconds of time stamps from 0 on."""
    steps = (1.0 + jitter * rng.uniform(-1.0, 1.0, int(2 * rate))) / rate
    return np.r_[0.0, np.cumsum(steps)]


@pytest.mark.parametrize("rate", [20.0, 100.0, 1000.0])
@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_the_state_in_the_middle_of_a_motion_is_found(
    rate: float, noise: float, jitter: float
) -> None:
    errors = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time = clock(rate, jitter, rng)
        state = read_state(time, position(time) + noise * rng.standard_normal(len(time)), noise)
        speed = AMPLITUDE * 2 * np.pi * FREQUENCY * np.cos(0.7)
        truth = AMPLITUDE * np.sin(0.7), speed
        found = (
            (state.position - truth[0], state.position_error),
            (
                state.speed - truth[1],
                state.speed_error,
            ),
        )
        errors.append([wrong / claimed for wrong, claimed in found])
    typical = np.sqrt(np.median(np.square(errors), axis=0))
    assert np.all(typical < 1.3)  # 0.67 for normal errors, 1 for slow motions taken as rests
    assert np.all(typical > 0.1)


def test_a_joint_at_rest_has_no_speed() -> None:
    rng, noise = np.random.default_rng(0), 1e-3
    time = clock(100.0, 0.2, rng)
    moving = 0
    for _ in range(200):
        state = read_state(time, 0.3 + noise * rng.standard_normal(len(time)), noise)
        assert state.position == pytest.approx(0.3, abs=4 * noise)
        moving += state.speed != 0.0
    assert moving <= 4


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_log_with_few_readings(count: int) -> None:
    time = 0.01 * np.arange(count)
    state = read_state(time, position(time), 1e-3)
    assert state.position == pytest.approx(float(position(np.zeros(1))[0]), abs=1e-3)


@pytest.mark.parametrize("late", [-0.05, 0.004, 0.5, 20.0])
def test_readings_may_begin_before_or_after_the_commands(late: float) -> None:
    """A sensor that begins late is taken at its first reading; one that begins early, at 0."""
    rng, noise = np.random.default_rng(1), 1e-3
    time = late + clock(100.0, 0.2, rng)
    at = late if late > 0.01 else 0.0
    state = read_state(time, position(time) + noise * rng.standard_normal(len(time)), noise)
    speed = (position(np.array([at + 1e-6])) - position(np.array([at - 1e-6])))[0] / 2e-6
    assert state.position == pytest.approx(float(position(np.array([at]))[0]), abs=5 * noise)
    assert state.speed == pytest.approx(speed, abs=0.3)


def test_an_encoder_that_never_moves_rests(tmp_path: Path) -> None:
    time = 0.01 * np.arange(50)
    assert read_state(time, np.full(50, 0.2), 0.0)[:2] == (0.2, 0.0)
    assert read_state(np.zeros(5), np.full(5, 0.2), 1e-3)[:2] == (0.2, 0.0)


MODEL = ARM.format(step=0.001, integrator="implicitfast", armature=0.005, rotor=0.01, kv=(1.0, 0.2))
NOISE = 5e-4


def write_log(folder: Path, offset: float = 0.0, scale: float = 1.0, seconds: float = 7.7) -> Path:
    """Log of the arm's own simulation from the middle of a motion on, with a wrong encoder."""
    (folder / "arm.xml").write_text(MODEL)
    (folder / "STUDY.yaml").write_text(STUDY.format(noise=NOISE))
    model = mujoco.MjModel.from_xml_string(MODEL)
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(3), []
    for k in range(230 + round(100 * seconds)):
        time = 0.01 * k
        data.ctrl[:] = 0.4 * np.sin(3.0 * time), 0.5 * np.cos(4.0 * time)
        if k >= 230:
            readings = data.qpos * [1.0, scale] + [0.0, offset] + NOISE * rng.standard_normal(2)
            rows.append([time - 2.3, *data.ctrl, *readings])
        mujoco.mj_step(model, data, 10)
    header = "time,m_upper,m_lower,upper,lower"
    np.savetxt(folder / "log.csv", rows, "%.9g", ",", header=header, comments="")
    return folder / "STUDY.yaml"


def test_a_large_error_of_a_zero_is_named_in_a_log_that_begins_in_a_motion(tmp_path: Path) -> None:
    study = load_study(write_log(tmp_path, offset=-0.3, seconds=4.0))
    ids = ("joint_offset", "force_offset", "encoder_scale", "centre_of_mass", "link_mass")
    found = diagnose(study, causes=[find_cause(id) for id in ids], options=Options(suggest=False))

    assert found.verdict is Verdict.NAMED
    [cause] = found.causes
    assert str(cause.candidate) == "joint_offset at lower (reading only)"
    assert cause.parameters["offset"].value == pytest.approx(-0.3, abs=1e-3)


def test_errors_of_the_initial_states_are_tolerances(tmp_path: Path) -> None:
    with Replayer(load_study(write_log(tmp_path))) as replayer:
        columns = tolerance_columns(replayer, [], replayer.residual([]))
        steps = 3  # columns of the time step
        late = replayer.measured.time > 3.0
        assert columns.shape[1] == steps + 4  # position and velocity of two joints
        for column in columns[:, steps:].T:
            assert np.linalg.norm(column) > 1.0
            assert np.linalg.norm(column[late]) < 0.01 * np.linalg.norm(column)


@pytest.mark.parametrize(
    ("moving", "resting", "share", "sure"),
    [(0.0, 9.0, 1.0, True), (9.0, 0.0, 0.0, False), (8.0, 9.0, 1.0, False)],
)
def test_replays_decide_whether_a_log_begins_at_rest(
    tmp_path: Path, moving: float, resting: float, share: float, sure: bool
) -> None:
    """The errors of both replays are in noises; where both are large, nothing is sure."""
    study = load_study(write_log(tmp_path))
    readings = measured(study)

    def predict(one: Study) -> Floats:
        fast = any(state.speed for state in one.episodes[0].states.values())
        return readings.value + (moving if fast else resting) * readings.noise

    found = with_likelier_start(study, readings, predict)
    for joint, state in found.episodes[0].states.items():
        read = study.episodes[0].states[joint]
        assert state.speed == share * read.speed
        assert (state.speed_error == read.speed_error) is sure
        assert sure or state.speed_error > abs(read.speed)


def left(study: Path, cause: str = "", **values: float) -> float:
    """RMS of what a cause at the lower joint leaves, with the log's own time step [noise]."""
    with Replayer(load_study(study)) as replayer:
        replayer.own_step = True
        hypothesis: Hypothesis = []
        if cause:
            found = find_cause(cause)
            [location] = [
                one
                for one in found.locations(replayer.system)
                if one.elements == ("lower",) and one.note == "reading only"
            ]
            parameters = found.parameters(replayer.system, location)
            hypothesis = [(Candidate(found, location, parameters), values)]
        return float(np.sqrt(np.mean(replayer.residual(hypothesis) ** 2)))


def test_a_log_that_begins_in_a_motion_is_replayed_to_the_noise(tmp_path: Path) -> None:
    assert left(write_log(tmp_path)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("offset", [0.04, -0.02])
def test_a_wrong_zero_shifts_where_the_replay_begins(tmp_path: Path, offset: float) -> None:
    study = write_log(tmp_path, offset=offset)
    assert left(study, "joint_offset", offset=offset) == pytest.approx(1.0, abs=0.1)
    assert left(study) > 20.0


@pytest.mark.parametrize("scale", [1.1, 0.5])
def test_a_wrong_scale_changes_where_the_replay_begins(tmp_path: Path, scale: float) -> None:
    study = write_log(tmp_path, scale=scale)
    assert left(study, "encoder_scale", scale=scale - 1.0) == pytest.approx(1.0, abs=0.1)
    assert left(study) > 10.0
