"""Can grasping: tests are on new postures, sentences follow the numbers, the video is made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.can_grasping import figures
from experiments.can_grasping import run as runner
from experiments.can_grasping.robot import SWEEP_DEG, CanRobot, swept_lengths
from experiments.can_grasping.run import Args, main
from experiments.can_grasping.tables import fall, metrics, outcome_table, share
from experiments.robots.conditions import ACTUAL, NOMINAL
from kengoro.grasp_trial import GraspTrial, Trial
from kengoro.hand_search import TrialOptions
from kengoro.trained_maps import trained_map

MUSCLES = 10


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    folder = Path(request.config.cache.mkdir("maps"))
    trained_map(folder)
    return folder


def test_the_map_is_tested_where_it_was_not_learned(
    maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Postures of learning and of the test are disjoint."""
    libraries, tested = [], []

    def run(trial: GraspTrial) -> Trial:
        libraries.append(trial._library)
        return trial.trial

    def visit(session: Any, target: np.ndarray, visits: Any) -> None:
        tested.append(target)
        visits["max_tension"].append(0.0)

    monkeypatch.setattr(GraspTrial, "run", run)
    monkeypatch.setattr("experiments.can_grasping.robot.visit", visit)
    robot = CanRobot(NOMINAL, 3, TrialOptions(), 5, maps)
    robot.run_trial()
    robot.test(robot.before)
    assert len(tested) == 5
    together = np.vstack([libraries[0], tested])
    assert len(np.unique(together, axis=0)) == len(together)


def test_without_departures_the_estimate_is_true(maps: Path) -> None:
    robot = CanRobot(NOMINAL, 3, TrialOptions(), 1, maps)
    found = robot.test(robot.before)
    assert found["estimate_true_deg"] < 0.2
    assert found["target_true_deg"] < 4.0


def test_lengths_are_swept_over_the_shoulders_flexion(maps: Path) -> None:
    jmm = trained_map(maps)
    lengths = swept_lengths(jmm, np.arange(3))
    posture = np.zeros(len(jmm.joints))
    posture[jmm.joints.index("sh_pitch")] = np.radians(-120.0)
    at = SWEEP_DEG.tolist().index(-120.0)
    np.testing.assert_allclose(lengths[at], 1e3 * jmm.lengths(posture)[:3], atol=0.01)
    assert np.shape(lengths) == (len(SWEEP_DEG), 3)


def trial(distances: list[float], grasped: bool) -> dict[str, Any]:
    """A trial of which only the last approach may lift the can."""
    approaches = [
        {
            "start_s": 100.0 * number,
            "hand_distance_mm": distance,
            "can_distance_mm": distance,
            "grasped": grasped and number == len(distances) - 1,
            "max_tension_N": 300.0 - 10 * number,
        }
        for number, distance in enumerate(distances)
    ]
    first = bool(approaches) and bool(approaches[0]["grasped"])
    return {
        "grasped_at_first_approach": first,
        "grasped_after": grasped,
        "approaches": approaches,
        "postures": 27,
        "updates": {"antagonism": 30, "vision": 26, "dropped": {}},
        "notes": [],
    }


def robot(distances: list[float], grasped: bool, after: float = 2.0) -> dict[str, Any]:
    errors = {"target_true_deg": 10.0, "target_true_mm": 200.0, "max_tension_N": 400.0}
    return {
        **trial(distances, grasped),
        "grasped_before": False,
        "grasped_before_from_the_last_target": False,
        "before": errors,
        "after": {**errors, "target_true_deg": after, "estimate_seen_deg": 1.0},
        "jmm_change_mm": 12.0,
        NOMINAL: trial([30.0], True),
    }


def test_metrics_count_robots_and_leave_out_what_is_not_there() -> None:
    robots = {0: robot([200.0, 20.0], True), 1: robot([], False), 2: robot([90.0, 80.0], False)}
    found = metrics(robots)
    assert found["grasped_after"]["median"] == pytest.approx(1 / 3, abs=1e-3)
    assert found["grasped_after"]["reached"] is False
    assert found["hand_last_approach"]["median"] == 50.0
    assert found["hand_first_approach_nominal"]["median"] == 30.0
    assert found["rmse_true_after"]["median"] == 2.0
    assert "rmse_seen_before" not in found
    assert found["jmm_change_mm"]["paper"] == 15.0
    rows = outcome_table(robots).rows
    assert rows[0][1] == "200, 20*"
    assert rows[1][1] == ""
    assert "after: 1." in outcome_table(robots).note


def test_a_share_has_an_interval_even_where_all_robots_are_alike() -> None:
    all_of_ten = share([True] * 10, 0.9)
    assert (all_of_ten["median"], all_of_ten["high"], all_of_ten["reached"]) == (1.0, 1.0, True)
    assert all_of_ten["low"] == pytest.approx(0.722, abs=1e-3)  # Wilson: 10 / (10 + 1.96^2)
    assert share([True, False])["worst"] == 0.0


def test_a_sentence_counts_robots_with_lower_errors() -> None:
    text = fall({0: robot([], False, after=2.0), 1: robot([], False, after=11.0)})
    assert "rmse_true on 1 of 2" in text
    assert "rmse_seen on 0 of 0" in text
    assert "max_tension on 0 of 2" in text


def test_a_video_is_of_the_first_robot_and_made_when_it_is_missing(
    maps: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    calls: list[tuple[str, int, bool]] = []

    def run(condition: str, seed: int, *_: Any, films: dict[int, Path], live: bool) -> Any:
        calls.append((condition, seed, live))
        if condition == NOMINAL:
            return {"summary": trial([30.0], True)}
        if seed in films:
            films[seed].parent.mkdir(parents=True, exist_ok=True)
            films[seed].write_bytes(b"%d" % seed)
        return {"summary": robot([200.0, 20.0], True), "curves": curves()}

    monkeypatch.setattr(runner, "run", run)
    monkeypatch.setattr(figures, "figures", lambda results: [])
    first = Args(seeds="3", out=tmp_path, cache=maps, jobs=1)
    summary = main(first)
    printed = " ".join(capsys.readouterr().out.split())
    assert "learned from 26 observations of its hand in 100 s. In approach 2 it grasped" in printed
    assert "median" not in printed
    assert calls == [(ACTUAL, 3, True), (NOMINAL, 3, True)]
    assert (tmp_path / "episode.mp4").read_bytes() == b"3"
    assert summary["per_seed"]["3"]["grasped_after"]
    calls.clear()
    main(Args(seeds="2-3", out=tmp_path, cache=maps, jobs=1))
    assert calls == [(ACTUAL, 2, False), (NOMINAL, 2, False)]
    assert (tmp_path / "episode.mp4").read_bytes() == b"2"
    calls.clear()
    main(first)
    assert calls == []
    assert (tmp_path / "episode.mp4").read_bytes() == b"3"
    (tmp_path / "robots" / "003.mp4").unlink()
    main(first)
    assert calls == [(ACTUAL, 3, True)]


def test_there_are_figures_even_of_a_robot_without_approaches() -> None:
    results = {
        seed: {
            ACTUAL: {"summary": robot(distances, False), "curves": curves()},
            NOMINAL: {"summary": trial([30.0], True)},
        }
        for seed, distances in ((3, []), (4, [200.0, 20.0]))
    }
    pictures = figures.figures(results)
    assert len(pictures) == 3
    assert all(picture.png.startswith(b"\x89PNG") for picture in pictures)


def curves() -> dict[str, Any]:
    sweep = [[0.0] * MUSCLES, [1.0] * MUSCLES]
    return {
        "time": [0.0, 1.0],
        "tensions": [[1.0], [2.0]],
        "true_error": [1.0, 2.0],
        "observation_time": [0.5],
        "observation_error": {"all": [3.0]},
        "approach_start": [0.1],
        "pitch": [-120.0, -118.0],
        "muscles": [f"muscle {k}" for k in range(MUSCLES)],
        "lengths_before": sweep,
        "lengths_after": sweep,
    }
