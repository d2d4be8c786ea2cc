"""Learning to grasp: new positions, resuming, metrics, rows for a learner, bad input."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.__main__ import main
from experiments.cloning.cloning import Training
from experiments.cloning.rows import RowArm
from experiments.learn_grasp import demonstrations, reward
from experiments.learn_grasp.demonstrations import Sizes, learn, train
from experiments.learn_grasp.episodes import LEARNED, ROWS, Run, demonstrated, judged
from experiments.learn_grasp.reward import CHANGE, RowEnv, commanded, trained_on
from experiments.learn_grasp.run import Args, conclude
from kengoro.study_model import study_model
from kengoro_env.assets import asset_path
from kengoro_env.tasks.can_grasp import CanGrasp
from mjcf_sandbox.files import write_bytes
from tests.kengoro.demonstrations.small_dataset import made_episode

SIZES = Sizes((2, 5), 100, 3, 1)


def test_judged_episodes_are_never_learned_from() -> None:
    seeds = {seed for robot in (None, *range(200)) for seed in judged(robot, 100)}
    learned = [demonstrated(seed, number) for seed in range(200) for number in range(100)]
    assert len(set(learned)) == len(learned)  # nor does a seed of the training repeat another's
    assert not seeds & set(learned)
    assert max(seeds) < LEARNED


def test_judged_positions_of_the_can_are_new() -> None:
    arm = RowArm(None)

    def cans(seeds: Sequence[int]) -> np.ndarray:
        return np.array([arm.reset(seed)["can_pose"][:2, 3] for seed in seeds])

    new, old = (
        cans(judged(None, 20)),
        cans([demonstrated(s, n) for s in range(2) for n in range(10)]),
    )
    arm.close()
    gaps = np.linalg.norm(new[:, None] - old, axis=-1)
    assert gaps.min() > 1e-6
    assert np.ptp(new, axis=0).min() > 0.04  # over most of the area


class Steps:
    """Stand-ins for what takes long, which count their calls; `broken` names one that fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls: list[Any] = []
        self.cans: set[str] = set()
        self.broken: Any = None
        for name in ("demonstrate", "train", "judge"):
            monkeypatch.setattr(demonstrations, name, getattr(self, name))

    def _count(self, *call: Any) -> None:
        if call == self.broken:
            raise RuntimeError("stopped")
        self.calls.append(call)

    def demonstrate(
        self, path: Path, seed: int, first: int, end: int, cache: Path | None, can: str
    ) -> int:
        self.cans.add(can)
        self._count("demonstrate", seed, first, end)
        write_bytes(path, b"examples")
        return end - first

    def train(self, path: Path, examples: Sequence[Path], epochs: int, seed: int) -> None:
        self._count("train", seed, len(examples), epochs)
        write_bytes(path, b"policy")

    def judge(self, path: Path, robot: int | None, episodes: int, can: str) -> dict[str, list[Any]]:
        self.cans.add(can)
        self._count("judge", path.stem, robot, episodes)
        return {
            "lifted": [path.stem.endswith("005")] * episodes,
            "seen": [robot != 21] * episodes,
            "errors": [0.001] * episodes,
        }


def test_policies_are_cloned_from_more_and_more_demonstrations(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = Steps(monkeypatch)
    found, work_s = learn(Run(tmp_path, "key", 1, None), [3], [20, 21], SIZES)
    assert steps.calls == [
        ("demonstrate", 3, 0, 2), ("demonstrate", 3, 2, 5), ("train", 3, 1, 50),
        ("train", 3, 2, 20), ("judge", "003-002", None, 3), ("judge", "003-005", None, 3),
        ("judge", "003-005", 20, 1), ("judge", "003-005", 21, 1),
    ]  # fmt: skip
    robots = {"020": [True], "021": [True]}
    assert found == {3: {"at": [2, 5], "lifted": [[False] * 3, [True] * 3], "robots": robots}}
    assert work_s >= 0.0
    assert steps.cans == {"state"}


def test_policies_by_camera_are_cloned_and_judged_by_camera_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, run = Steps(monkeypatch), Run(tmp_path, "key", 1, None)
    learn(run, [3], [20, 21], SIZES)
    before, steps.calls, steps.cans = steps.calls, [], set()
    found, _ = learn(run, [3], [20, 21], SIZES, "camera")
    assert steps.calls == before  # nothing of the policies by state is used again
    assert steps.cans == {"camera"}
    assert found[3]["cans"] == {
        "drawing": {"seen": [True] * 3, "errors": [0.001] * 3},
        "020": {"seen": [True], "errors": [0.001]},
        "021": {"seen": [False], "errors": [0.001]},
    }


def test_demonstrations_by_camera_hold_what_it_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Agent:
        def close(self) -> None:
            """Nothing is open."""

    monkeypatch.setattr(demonstrations, "learned_agent", lambda *_, **__: Agent())
    monkeypatch.setattr(demonstrations, "grasps", lambda *_: [made_episode(0)])
    stored = {}
    for can in ("state", "camera"):
        path = tmp_path / f"{can}.npz"
        assert demonstrations.demonstrate(path, 0, 0, 1, None, can) == 1
        with np.load(path) as arrays:
            stored[can] = arrays["inputs"]
    at = slice(145, 147)  # after lengths and tensions of now and of the start, and the time
    arm = RowArm(None)
    true = arm.reset(demonstrated(0, 0))["can_pose"][:2, 3]
    arm.close()
    np.testing.assert_array_equal(stored["state"][:, at], np.zeros((3, 2)))  # of the episode
    gaps = np.linalg.norm(stored["camera"][:, at] - true, axis=1)
    assert 0.0 < gaps[0] < 0.005
    assert np.ptp(gaps) == 0.0


@pytest.mark.parametrize(
    "broken", [("demonstrate", 1, 2, 5), ("train", 1, 1, 50), ("judge", "001-005", None, 3)]
)
def test_an_interrupted_run_goes_on_without_changes(
    broken: tuple[Any, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = Steps(monkeypatch)
    run = Run(tmp_path / "one", "key", 1, None)
    steps.broken = broken
    with pytest.raises(RuntimeError, match="stopped"):
        learn(run, [0, 1], [20], SIZES)
    done, steps.broken = list(steps.calls), None
    found, _ = learn(run, [0, 1], [20], SIZES)
    assert len(set(steps.calls)) == len(steps.calls)  # nothing ran twice
    assert broken in steps.calls[len(done) :]
    assert found == learn(Run(tmp_path / "two", "key", 1, None), [0, 1], [20], SIZES)[0]
    before = len(steps.calls)
    assert learn(run, [0, 1], [20], SIZES)[0] == found
    assert len(steps.calls) == before


def test_a_policy_that_was_removed_is_trained_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = Steps(monkeypatch)
    run = Run(tmp_path, "key", 1, None)
    learn(run, [0], [], SIZES)
    (path,) = tmp_path.rglob("policies-*/000-005.npz")
    path.unlink()
    steps.calls.clear()
    learn(run, [0], [], SIZES)
    assert steps.calls == [("train", 0, 2, 20)]


def test_a_training_has_all_demonstrations_until_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[tuple[dict[str, Any], Training]] = []
    monkeypatch.setattr(demonstrations, "clone", lambda _, *rest: given.append(rest))
    for number, rows in enumerate((2, 3)):
        np.savez(
            tmp_path / f"{number}.npz", groups=np.full(rows, number), inputs=np.ones((rows, 4))
        )
    train(tmp_path / "own.npz", [tmp_path / "0.npz", tmp_path / "1.npz"], 7, 3)
    ((arrays, training),) = given
    np.testing.assert_array_equal(arrays["groups"], [0, 0, 1, 1, 1])
    assert arrays["inputs"].shape == (5, 4)
    assert training == Training(7, 3)


def results(*shares: float) -> dict[int, dict[str, Any]]:
    """A result for each seed, with a share of lifted cans at the end; 20 is lifted by the first."""
    return {
        seed: {
            "at": [2, 5],
            "lifted": [[False] * 10, [i < round(10 * share) for i in range(10)]],
            "robots": {"020": [seed == 0], "021": [False]},
        }
        for seed, share in enumerate(shares)
    }


@pytest.mark.parametrize(("worst", "reached"), [(0.6, True), (0.5, False)])
def test_the_worst_seed_decides(tmp_path: Path, worst: float, reached: bool) -> None:
    found = conclude(Args(out=tmp_path), {}, results(1.0, 0.9, worst), 30.0, 31.0)
    own = found["metrics"]["lifted on the drawing"]
    assert (own["must"], own["by"], own["reached"]) == (0.6, "worst", reached)
    assert (own["median"], own["worst"]) == (0.9, worst)
    assert found["metrics"]["lifted on other robots"]["median"] == pytest.approx(1 / 6, rel=1e-3)
    assert found["metrics"]["lifted on other robots"]["must"] is None
    assert found["core_s_per_seed"] == 10.0
    (table,) = found["tables"]
    assert [row[:3] for row in table["rows"]] == [
        ["2", "drawing", "0%"], ["5", "drawing", "90%"], ["5", "020", "0%"], ["5", "021", "0%"],
    ]  # fmt: skip
    written = json.loads((tmp_path / "summary.json").read_text())
    assert written["metrics"] == found["metrics"]
    assert written["per_seed"]["2"]["lifted"] == [0.0, worst]
    assert (tmp_path / "figure_1.png").stat().st_size > 5000
    assert "data:image/png" in (tmp_path / "report.html").read_text()


def test_the_summary_has_the_episodes_in_which_the_can_was_not_seen(tmp_path: Path) -> None:
    learned = results(1.0, 1.0)
    for one in learned.values():
        one["cans"] = {
            "drawing": {"seen": [True] * 10, "errors": [0.001] * 10},
            "020": {"seen": [True], "errors": [0.02]},
            "021": {"seen": [False], "errors": [0.045]},
        }
    found = conclude(Args(can="camera", out=tmp_path), {}, learned, 1.0, 1.0)
    assert found["can"] == "camera"
    assert found["metrics"]["can not seen"]["median"] == pytest.approx(1 / 12, rel=1e-3)
    _, table = found["tables"]
    assert table["rows"] == [
        ["drawing", "10 of 10", "1.0", "1.0"], ["020", "1 of 1", "20.0", "20.0"],
        ["021", "0 of 1", "45.0", "45.0"],
    ]  # fmt: skip
    assert "not seen in 1 of 12 judged episodes" in table["note"]


def test_what_the_reward_teaches_is_a_metric_without_a_threshold(tmp_path: Path) -> None:
    learned = results(0.0, 0.0)
    for one in learned.values():
        one |= {"reward": [[0.0] * 10, [0.2] * 10], "distance": [[0.5] * 10, [0.07] * 10]}
        one["robots_distance"] = {"020": [0.1, 0.3], "021": [0.4]}
    metrics = conclude(Args(by="reward", out=tmp_path), {}, learned, 1.0, 1.0)["metrics"]
    assert metrics["lifted on the drawing"]["reached"] is False
    assert (metrics["reward"]["median"], metrics["reward"]["must"]) == (0.2, None)
    assert metrics["distance"]["worst"] == 0.07
    assert metrics["distance on other robots"]["worst"] == 0.4
    assert "can not seen" not in metrics


def test_a_learner_has_rows_of_about_unit_size_and_the_reward_of_the_environment() -> None:
    env, arm = RowEnv(None), RowArm(None)
    observation, _ = env.begin(4)
    arm.reset(4)
    assert observation.shape == env.observation_space.shape
    assert np.abs(observation).max() < 4.0
    action = np.full(37, 0.5, dtype=np.float32)
    for _ in range(3):
        expected = arm.step(commanded(arm.command, action))[0]
        _, found, ended, cut, _ = env.step(action)
        assert (found, ended, cut) == (expected, False, False)
    env._row = ROWS - 1
    assert env.step(action)[3]
    env.close()
    arm.close()


def test_an_action_changes_the_command_but_is_that_of_the_fingers() -> None:
    found = commanded(np.array([0.5, 0.95, -1.0]), np.array([-1.0, 1.0, 0.3]))
    np.testing.assert_allclose(found, [0.5 - CHANGE, 1.0, 0.3])


def test_a_learner_has_another_guessed_model_in_each_episode_and_the_same_ones_for_a_seed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(reward, "GUESSES", 3)
    models, again = trained_on("guessed", 5), trained_on("guessed", 5)
    assert models is not None
    assert again is not None
    assert [mass_of(model) for model in models] == [mass_of(model) for model in again]
    env = RowEnv(None, models)
    env.reset(seed=0)
    found = []
    for _ in range(12):
        env.reset()
        found.append(env._arm._world.robot.model.body("can").mass[0])
    env.close()
    assert set(found) == {mass_of(model) for model in models}
    assert len(set(found)) == 3
    assert trained_on("drawing", 5) is None


def mass_of(model: Any) -> float:
    return float(model.compile().body("can").mass[0])


def test_a_learner_on_the_drawing_has_the_same_episodes_as_one_on_models() -> None:
    nominal = study_model(asset_path(CanGrasp.scene), fingers=True)
    envs = [RowEnv(None), RowEnv(None, [nominal])]
    for _ in range(2):
        one, other = (env.reset(seed=3)[0] for env in envs)
        np.testing.assert_allclose(one, other, atol=1e-5)
        one, other = (env.step(np.full(37, 0.4, np.float32))[0] for env in envs)
        np.testing.assert_allclose(one, other, atol=1e-3)
    for env in envs:
        env.close()


def test_a_learner_never_has_a_judged_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    env = RowEnv(None)
    seeds: list[int] = []
    monkeypatch.setattr(reward.RowEnv, "begin", lambda _, seed: seeds.append(seed))
    env.reset(seed=0)
    for _ in range(50):
        env.reset()
    assert len(set(seeds)) == 51
    assert min(seeds) >= LEARNED
    env.close()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--seeds", "x"], "Seeds are 'x'; give one such as 3 or a range such as 0-9.\n"),
        (["--robots", "9-8"], "Seeds are '9-8', but a range must end with its higher number.\n"),
        (["--rows", "0"], "Rows are 0, but at least 1 is needed.\n"),
        (
            ["--by", "reward", "--can", "camera"],
            "Training from the reward renders no frames, so that the can's position is that of "
            "the state: leave --can out, or give --by demonstrations.\n",
        ),
        (
            ["--models", "guessed"],
            "Demonstrations are those on the drawing: leave --models out, or give --by reward for "
            "policies that are trained on guessed models.\n",
        ),
        (["--jobs", "0"], "Jobs are 0, but at least 1 is needed.\n"),
    ],
)
def test_bad_input_is_one_sentence(
    options: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["learn-grasp", "--out", str(tmp_path / "new"), *options]) == 2
    assert capsys.readouterr().err == sentence
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
@pytest.mark.parametrize("can", ["state", "camera"])
def test_the_small_version_runs_and_goes_on(
    can: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    maps = request.config.cache.mkdir("maps")
    arguments = ["--quick", "--can", can, "--seeds", "0", "--robots", "20", "--cache", str(maps)]
    assert main(["learn-grasp", *arguments, "--out", str(tmp_path)]) == 0
    first = json.loads((tmp_path / "summary.json").read_text())
    assert main(["learn-grasp", *arguments, "--out", str(tmp_path)]) == 0
    again = json.loads((tmp_path / "summary.json").read_text())
    assert again["per_seed"] == first["per_seed"]
    assert again["core_s"] == first["core_s"]


@pytest.mark.slow
@pytest.mark.torch
@pytest.mark.parametrize("models", ["drawing", "guessed"])
def test_learning_from_the_reward_runs(models: str, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    arguments = ["--by", "reward", "--models", models, "--quick", "--seeds", "0", "--robots", "20"]
    assert main(["learn-grasp", *arguments, "--out", str(tmp_path)]) == 0
    found = json.loads((tmp_path / "summary.json").read_text())
    assert found["per_seed"]["0"]["at"] == [0, 1024]
    assert found["models"] == models
    assert 0.0 < found["metrics"]["reward"]["median"] < 1.0
