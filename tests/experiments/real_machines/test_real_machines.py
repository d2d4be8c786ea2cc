"""Real machines: logs like the measured ones go through the runner; unusable ones are named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.harness.errors import ExperimentError
from experiments.real_machines import baselines, run, trial, tx40, xl330
from experiments.real_machines.baselines import fit
from experiments.real_machines.machines import MACHINES, missing
from experiments.real_machines.parameters import predict
from experiments.real_machines.run import Args
from experiments.real_machines.tables import metrics
from experiments.real_machines.trial import EXTENDED, NOMINAL, held_out_errors
from jmm_agent.types import Floats
from reality_gap.causes import CATALOGUE
from reality_gap.study.measurements import measured

SECONDS, RATE = 2.5, 100.0
FRICTION, DELAY = 0.03, 0.02
NAME = "xl330_kp400"


def entries(friction: float, late: float, steps: int) -> list[dict[str, Any]]:
    """Entries of a run: a pendulum like the measured one, with friction and a late servo."""
    log = xl330.Log("sine", 0.3, 0.1, 400.0, 7.4, np.zeros((1, 3)), True)
    spec = mujoco.MjSpec.from_string(xl330.model(log))
    spec.joint("axis").frictionloss = friction
    model = spec.compile()
    data = mujoco.MjData(model)
    every = round(1.0 / RATE / model.opt.timestep)
    found = []
    for k in range(steps):
        goal, sent = (0.6 * np.sin(4.0 * max(k / RATE - d, 0.0) ** 1.3) for d in (0.0, late))
        angle = np.round(data.qpos[0] / 0.00153) * 0.00153
        found.append({"timestamp": 0.003 + k / RATE, "goal_position": goal, "position": angle})
        found[-1]["torque_enable"] = True
        data.ctrl[0] = sent
        mujoco.mj_step(model, data, every)
    return found


def write(data: Path, rows: list[dict[str, Any]], **more: Any) -> Path:
    """Write a run to the user's folder."""
    run = {"mass": 0.3, "length": 0.1, "kp": 400, "vin": 7.4, "trajectory": "sine"}
    (data / xl330.FOLDER).mkdir(parents=True, exist_ok=True)
    path = data / xl330.FOLDER / "run.json"
    path.write_text(json.dumps(run | {"entries": rows} | more))
    return path


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("machines")
    write(folder, entries(FRICTION, DELAY, round(SECONDS * RATE)))
    return folder


def test_the_loader_writes_a_study_of_the_powered_runs_at_one_gain(
    data: Path, tmp_path: Path
) -> None:
    study = MACHINES[NAME].study(data, tmp_path / "study", 2.0)
    assert study.duration == pytest.approx(2.0, abs=0.02)
    model = study.spec().compile()
    # Manual: kp / 128 steps of the pulse width (885) per count (4096 a turn); 7.4 V, 0.52 N m and
    # 1.47 A at 5 V at a standstill.
    assert model.actuator_gainprm[0, 0] == pytest.approx(1.772, abs=2e-3)
    assert model.actuator_forcerange[0, 1] == pytest.approx(7.4 / 5.0 * 0.52, rel=1e-4)
    assert model.body_mass[1] == pytest.approx(0.3)
    with pytest.raises(ExperimentError, match="no run with kp 100"):
        MACHINES["xl330_kp100"].study(data, tmp_path / "other", 2.0)


def test_baselines_find_what_they_free_and_are_scored_on_held_out_readings(
    data: Path, tmp_path: Path
) -> None:
    study = MACHINES[NAME].study(data, tmp_path / "study", 10.0)
    baseline = fit(study, ("friction", "delay"))
    assert baseline.values["friction"] == pytest.approx(FRICTION, abs=0.006)
    assert baseline.values["delay"] == pytest.approx(DELAY, abs=0.003)
    readings = measured(study)
    errors = [
        held_out_errors(study, readings, prediction)["angle [rad]"]
        for prediction in (predict(study, readings, {}), baseline.prediction)
    ]
    assert errors[1] < 0.002
    assert errors[0] > 10 * errors[1]
    # The servo holds its encoder at the goal, so that a zero shows in gravity's share only.
    shift = predict(study, readings, {"bias": 0.1}) - predict(study, readings, {})
    gravity = 0.3 * 9.81 * 0.1
    shown = 0.1 * gravity / (1.772 + gravity)
    assert np.mean(shift[len(shift) // 2 :]) == pytest.approx(shown, abs=0.004)
    heavier = predict(study, readings, {"mass": 0.3, "gain": -0.2, "bias": 0.1})
    assert held_out_errors(study, readings, heavier)["angle [rad]"] > 0.02


def held_out(time: Floats) -> NDArray[np.bool_]:
    """Whether readings at some times [s] are in each fourth quarter of a second, shape (n,)."""
    return np.floor(4.0 * time) % 4 == 3


def test_held_out_readings_are_scored_and_never_fitted(data: Path, tmp_path: Path) -> None:
    study = MACHINES[NAME].study(data, tmp_path / "study", 10.0)
    study = replace(study, channels=(replace(study.channels[0], noise=1e-3),))
    readings = measured(study)
    scored = held_out(readings.time)
    errors = held_out_errors(study, readings, readings.value + np.where(scored, 0.01, 5.0))
    assert errors == {"angle [rad]": pytest.approx(0.01), "all": pytest.approx(10.0)}
    [episode] = study.episodes
    [reading] = episode.readings
    wrong = np.where(held_out(reading.time), 0.3 - reading.value, reading.value)
    changed = replace(episode, readings=(replace(reading, value=wrong),))
    baseline = fit(replace(study, episodes=(changed,)), ("friction", "delay"))
    assert baseline.values["friction"] == pytest.approx(FRICTION, abs=0.006)
    assert baseline.values["delay"] == pytest.approx(DELAY, abs=0.003)


def test_a_log_goes_through_the_runner(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = tmp_path / "data"
    write(data, entries(0.0, DELAY, round(SECONDS * RATE)))
    some = [CATALOGUE["delay"]]
    diagnose = trial.diagnose
    monkeypatch.setattr(
        trial, "diagnose", lambda study, options: diagnose(study, causes=some, options=options)
    )
    monkeypatch.setattr(trial, "write_diagnosis", lambda found, study, out: out.mkdir())
    kinds = {"one": ("friction", "gain"), "two": ("friction", "delay")}
    monkeypatch.setitem(MACHINES, NAME, MACHINES[NAME]._replace(baselines=kinds))
    summary = run.main(Args(data, tmp_path / "out"))
    saved = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert saved["metrics"] == summary["metrics"]
    found = saved["machines"][NAME]
    assert [cause["cause"] for cause in found["causes"]] == ["delay"]
    errors = {key: one["angle [rad]"] for key, one in found["errors"].items()}
    assert errors[EXTENDED] < 0.2 * errors[NOMINAL]
    metric = saved["metrics"][f"ratio_{NAME}"]
    assert metric["value"] == found["ratio"]
    assert found["ratio"] == pytest.approx(errors[EXTENDED] / min(errors["one"], errors["two"]))
    assert metric["reached"] == (found["ratio"] <= 1.05)
    assert set(saved["skipped"]) == set(MACHINES) - {NAME}
    assert "no run with kp 100" in saved["skipped"]["xl330_kp100"]
    assert "emps_train.csv" in saved["skipped"]["emps"]
    assert (tmp_path / "out" / NAME / "diagnosis").is_dir()
    assert (tmp_path / "out" / "report.html").stat().st_size > 20_000
    monkeypatch.delattr(trial, "diagnose")  # what was diagnosed among all is so among some
    again = run.main(Args(data, tmp_path / "out", only=(NAME,)))
    assert again["machines"] == saved["machines"]
    assert again["wall_s"] >= again["core_s"] > 0.0


def test_missing_files_are_named(tmp_path: Path) -> None:
    sentence = missing("emps", tmp_path)
    assert sentence is not None
    assert str(Path("emps") / "emps_train.csv") in sentence
    with pytest.raises(ExperimentError, match=r"No machine can be used.*bam_xl330.*emps_train"):
        run.main(Args(tmp_path, tmp_path / "out"))
    with pytest.raises(ExperimentError, match="no folder"):
        run.main(Args(tmp_path / "none", tmp_path / "out"))
    with pytest.raises(ExperimentError, match="no machine 'robot'; there are: xl330"):
        run.main(Args(tmp_path, tmp_path / "out", only=("robot",)))
    for file in (tx40.POSITION, tx40.TORQUE):
        path = tmp_path / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    sentence = missing("tx40", tmp_path)
    assert sentence is not None
    assert "tx40_mdh_modified.urdf" in sentence


def test_a_missing_extra_is_named_before_the_first_diagnosis(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(baselines, "sysid_installed", lambda: False)
    with pytest.raises(ExperimentError, match=r"pip install 'mujoco\[sysid\]'"):
        run.main(Args(data, tmp_path / "out", only=(NAME,)))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "printed"),
    [
        ("{", "cannot be read"),
        ("[]", "cannot be read"),
        ('{"mass": 0.3, "length": 0.1, "kp": 400, "vin": 7.4}', "entries"),
        ('{"mass": null}', "cannot be read"),
    ],
)
def test_a_broken_file_gets_one_sentence(tmp_path: Path, content: str, printed: str) -> None:
    path = write(tmp_path, [])
    path.write_text(content)
    with pytest.raises(ExperimentError) as caught:
        run.main(Args(tmp_path, tmp_path / "out", only=(NAME,)))
    text = str(caught.value)
    assert printed in text
    assert path.name in text
    assert "\n" not in text


def test_a_run_with_bad_rows_gets_one_sentence(tmp_path: Path) -> None:
    rows = entries(0.0, 0.0, 120)
    rows[7]["timestamp"] = 0.0
    path = write(tmp_path, rows)
    with pytest.raises(ExperimentError, match=r"run\.json has 120 entries.*times that rise"):
        xl330.read_log(path)
    rows[7]["timestamp"] = 0.073
    del rows[9]["goal_position"]
    write(tmp_path, rows)
    with pytest.raises(ExperimentError, match=r"'goal_position' is missing"):
        xl330.read_log(path)
    write(tmp_path, entries(0.0, 0.0, 120), mass=float("inf"))
    with pytest.raises(ExperimentError, match="mass"):
        xl330.read_log(path)


def test_metrics_compare_with_the_best_baseline() -> None:
    done = {"a": {"ratio": 1.04}, "b": {"ratio": 1.06}}
    found = metrics(done)
    assert found["ratio_a"]["reached"]
    assert not found["ratio_b"]["reached"]
    assert found["below_best_baseline"] == {
        "must": "at least 0.5",
        "value": 0.0,
        "unit": "of machines",
        "reached": False,
    }
