"""Behaviour cloning of grasps: inputs, training, judgement, bad input."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.__main__ import main
from experiments.clone_grasp import run
from experiments.clone_grasp.features import LAGS, examples, features
from experiments.clone_grasp.policy import ClonedPolicy, lifts
from experiments.clone_grasp.run import DRAWING, HISTORY, Args, Sizes, clone, conclude
from experiments.harness.errors import ExperimentError
from kengoro.demonstrations.episode import Episode
from kengoro.demonstrations.robot_file import RobotEpisodes
from kengoro.errors import UsageError
from tests.kengoro.demonstrations.small_dataset import made_episode

READ = 72
"""Lengths and tensions of all muscles."""


def test_the_present_readings_the_time_and_the_can_are_always_given() -> None:
    readings = [np.full(READ, float(i)) for i in range(4)]
    found = features(readings, np.array([0.4, -0.1]), history=False)
    np.testing.assert_array_equal(found, [*readings[3], 3.0, 0.4, -0.1])


def test_a_history_begins_with_the_start_and_holds_earlier_readings() -> None:
    readings = [np.full(READ, float(i)) for i in range(6)]
    found = features(readings, np.array([0.4, -0.1]), history=True)[READ + 3 :]
    earlier = found.reshape(1 + len(LAGS), READ)
    np.testing.assert_array_equal(earlier[:, 0], [0.0, 4.0, 3.0, 1.0, 0.0])


def test_examples_pair_readings_of_a_row_with_the_command_at_its_end() -> None:
    episode = made_episode(0)  # of 23 steps, so 3 rows
    inputs, commands = examples(episode, history=False)
    np.testing.assert_array_equal(commands, episode.actions[[9, 19, 22]])
    np.testing.assert_array_equal(inputs[:, :36], episode.lengths[[0, 10, 20]])
    np.testing.assert_array_equal(inputs[:, 72], [0, 1, 2])
    np.testing.assert_array_equal(inputs[:, 73:], np.tile(episode.can_pose[0, :2, 3], (3, 1)))


def test_grasps_that_failed_are_not_cloned(tmp_path: Path) -> None:
    lifted, failed = made_episode(0), made_episode(1)
    robots = [RobotEpisodes(3, (lifted, failed), ()), RobotEpisodes(4, (failed,), ())]
    found = run.clone_examples(robots, history=False)
    np.testing.assert_array_equal(found["commands"], examples(lifted, history=False)[1])
    np.testing.assert_array_equal(found["robots"], [3, 3, 3])
    with pytest.raises(ExperimentError, match="lifted in no demonstration"):
        run.clone_examples(robots[1:], history=False)


def linear_robots() -> list[RobotEpisodes]:
    """Robots whose commands are a linear function of the lengths of the row."""
    rng = np.random.default_rng(0)
    slope = rng.normal(size=(37, 4)) * 2.0
    found = []
    for robot in range(5):
        steps = 400
        rows = np.repeat(rng.uniform(-0.1, 0.1, (steps // 10, 4)), 10, axis=0)
        lengths = np.zeros((steps + 1, 36))
        lengths[:-1, :4] = rows
        lifted = np.ones(steps + 1, dtype=bool)
        actions = (rows @ slope.T).astype(np.float32)
        actions[:, -1] = np.where(rows[:, 0] > 0, 1.0, -1.0)
        own = replace(
            made_episode(0), lengths=lengths, tensions=np.zeros((steps + 1, 36)), actions=actions,
            rewards=np.zeros(steps), can_pose=np.tile(np.eye(4), (steps + 1, 1, 1)),
            success=lifted, grasped=lifted,
        )  # fmt: skip
        found.append(RobotEpisodes(robot, (own,), (np.zeros((3, 256), dtype=np.int64),)))
    return found


def commands_of(policy: ClonedPolicy, episode: Episode) -> np.ndarray:
    inputs, _ = examples(episode, policy.history)
    return np.array([policy(row) for row in inputs])


def test_a_policy_repeats_what_it_was_cloned_from_with_the_same_bits(tmp_path: Path) -> None:
    robots = linear_robots()
    sizes = Sizes(epochs=100)
    path = clone(tmp_path / "one", robots, "present", sizes, "source")
    with np.load(path) as stored:
        losses = stored["losses"]
    assert losses.shape == (100, 2)
    assert losses[-1, 1] < 0.3 * losses[0, 1]
    policy = ClonedPolicy(path, history=False)
    episode = robots[0].episodes[0]
    wanted = episode.actions[9::10]
    found = commands_of(policy, episode)
    error = found[:, :-1] - wanted[:, :-1]
    assert error.std() < 0.4 * wanted[:, :-1].std()
    assert np.mean(found[:, -1] == wanted[:, -1]) > 0.9
    assert set(np.unique(found[:, -1])) == {-1.0, 1.0}

    again = clone(tmp_path / "two", robots, "present", sizes, "source")
    assert again.read_bytes() == path.read_bytes()
    changed = path.stat().st_mtime_ns
    assert clone(tmp_path / "one", robots, "present", sizes, "source") == path
    assert path.stat().st_mtime_ns == changed  # not trained again


def test_a_failed_training_is_one_sentence(tmp_path: Path) -> None:
    robots = linear_robots()[:1]  # none is left to learn from
    with pytest.raises(ExperimentError, match="training of the policy 'present' failed: "):
        clone(tmp_path, robots, "present", Sizes(epochs=1), "source")


def test_a_damaged_demonstration_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def make_datasets(*_: Any) -> None:
        raise UsageError("000.npz is damaged; remove it, and this robot runs again.")

    monkeypatch.setattr(run, "make_datasets", make_datasets)
    with pytest.raises(ExperimentError, match="damaged; remove it"):
        run.demonstrations(Args(out=tmp_path), [0, 1], Sizes(), "source")


def test_a_policy_that_holds_still_lifts_no_can() -> None:
    class Still(ClonedPolicy):
        def __init__(self) -> None:
            self.history, self.calls = True, 0

        def __call__(self, inputs: np.ndarray) -> np.ndarray:
            self.calls += 1
            assert inputs.shape == (READ + 3 + READ * (1 + len(LAGS)),)
            return np.zeros(37, dtype=np.float32)

    policy = Still()
    assert lifts(policy, 3, 3, 2, 2) == [False, False]
    assert policy.calls == 4


def results(agent: float, history: float, present: float) -> dict[str, dict[str, list[bool]]]:
    """Ten episodes on each of two robots and on the drawing, of which a share is lifted."""

    def lifted(share: float) -> list[bool]:
        return [i < round(10 * share) for i in range(10)]

    found = {"agent": {"020": lifted(agent), "021": lifted(agent)}}
    for name, share in (("history", history), ("present", present)):
        found[name] = {"020": lifted(share), "021": lifted(share / 2), DRAWING: lifted(share)}
    return found


@pytest.mark.parametrize(("history", "reached"), [(0.6, True), (0.4, False)])
def test_the_summary_has_both_policies_beside_the_agent(
    tmp_path: Path, history: float, reached: bool
) -> None:
    args = Args(out=tmp_path)
    found = conclude(args, Sizes(), [20, 21], results(1.0, history, 0.2), [True] * 9 + [False], 1.0)
    metrics = found["metrics"]
    assert metrics["learning agent, on new robots"]["median"] == 1.0
    assert metrics["cloned, with a history, on new robots"]["median"] == pytest.approx(
        0.75 * history
    )
    assert metrics["cloned, with a history, on new robots"]["worst"] == pytest.approx(history / 2)
    assert metrics["cloned, without a history, on new robots"]["must"] is None
    judged = metrics["cloned, with a history, on the drawing"]
    assert (judged["must"], judged["reached"]) == (0.6, reached)
    (table,) = found["tables"]
    assert table["rows"][0] == ["learning agent", "20 of 20", "100%", "-"]
    assert table["rows"][2] == ["cloned, without a history", "3 of 20", "10%", "2 of 10"]
    assert found["demonstrations"] == {"episodes": 10, "lifted": 9}
    written = json.loads((tmp_path / "summary.json").read_text())
    assert written["metrics"] == metrics
    assert (tmp_path / "figure_1.png").stat().st_size > 5000
    assert "data:image/png" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--seeds", "10-25"], "Policies are cloned from the robots 0-19 and judged on 10-25;"),
        (["--robots", "3"], "Policies are cloned from the robots 3 and judged on 20-29; at least"),
        (["--seeds", "x"], "Seeds are 'x'; give one such as 3"),
        (["--jobs", "0"], "Jobs are 0, but at least 1 is needed."),
    ],
)
def test_bad_input_is_one_sentence(
    options: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["clone-grasp", "--out", str(tmp_path / "new"), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith(sentence)
    assert error.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_every_policy_is_judged_on_all_robots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[tuple[Any, ...]] = []

    def run_agent(robot: int, *_: Any) -> list[bool]:
        ran.append(("agent", robot))
        return [True]

    def run_cloned(path: Path, name: str, robot: int | None, *_: Any) -> list[bool]:
        ran.append((name, robot))
        return [False]

    monkeypatch.setattr(run, "run_agent", run_agent)
    monkeypatch.setattr(run, "run_cloned", run_cloned)
    policies = {}
    for name in HISTORY:
        policies[name] = tmp_path / f"{name}.npz"
        policies[name].write_bytes(name.encode())
    args = Args(out=tmp_path)
    found = run.judge(args, [20, 21], policies, 70, Sizes(), "source")
    assert ran == [
        ("agent", 20), ("agent", 21), ("history", 20), ("history", 21), ("history", None),
        ("present", 20), ("present", 21), ("present", None),
    ]  # fmt: skip
    assert found["history"][DRAWING] == [False]
    # Other weights are judged again, the agent is not.
    ran.clear()
    policies["present"].write_bytes(b"other weights")
    run.judge(args, [20, 21], policies, 70, Sizes(), "source")
    assert ran == [("present", 20), ("present", 21), ("present", None)]


@pytest.mark.slow
def test_the_small_version_runs_and_goes_on(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    maps = request.config.cache.mkdir("maps")
    arguments = ["--robots", "0-1", "--seeds", "20", "--out", str(tmp_path), "--cache", str(maps)]
    assert main(["clone-grasp", "--quick", *arguments]) == 0
    first = json.loads((tmp_path / "summary.json").read_text())
    assert main(["clone-grasp", "--quick", *arguments]) == 0
    again = json.loads((tmp_path / "summary.json").read_text())
    assert again["metrics"] == first["metrics"]
    assert again["wall_s"] < first["wall_s"]
