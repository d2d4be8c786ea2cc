"""Cloned policies: inputs, training, judgement."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.cloning.can_camera import MIDDLE, CanCamera
from experiments.cloning.cloning import Demonstration, Training, clone, clone_examples
from experiments.cloning.features import EXACT, examples, features, origin
from experiments.cloning.policy import ClonedPolicy, lifts
from experiments.cloning.rows import RowArm
from experiments.harness.errors import ExperimentError
from kengoro.demonstrations.episode import Episode
from kengoro_env.env import KengoroEnv
from tests.kengoro.demonstrations.small_dataset import made_episode

READ = 72
"""Lengths and tensions of all muscles."""


def test_readings_time_and_can_are_given_without_a_history() -> None:
    readings = [np.full(READ, float(i)) for i in range(4)]
    found = features(readings, np.array([0.4, -0.1]), history=False)
    assert len(found) == READ + EXACT
    np.testing.assert_array_equal(found[: READ + 3], [*readings[3], 3.0, 0.4, -0.1])
    later = features([*readings, readings[3]], np.array([0.4, -0.1]), history=False)
    np.testing.assert_array_equal(later[:READ], found[:READ])
    assert np.abs(later[READ + 3 :] - found[READ + 3 :]).max() > 0.2  # one row is a clear step


def test_readings_count_from_those_of_the_start_with_a_history() -> None:
    readings = [np.full(READ, 2.0 + i) for i in range(6)]
    found = features(readings, np.array([0.4, -0.1]), history=True)
    np.testing.assert_array_equal(found[:READ], np.full(READ, 5.0))
    np.testing.assert_array_equal(found[READ : 2 * READ], readings[0])
    np.testing.assert_array_equal(found[2 * READ : 2 * READ + 3], [5.0, 0.4, -0.1])


def test_examples_pair_readings_of_a_row_with_the_command_at_its_end() -> None:
    episode = made_episode(0)  # of 23 steps, so 3 rows
    inputs, commands = examples(episode, history=False)
    np.testing.assert_array_equal(commands, episode.actions[[9, 19, 22]])
    np.testing.assert_array_equal(inputs[:, :36], episode.lengths[[0, 10, 20]])
    np.testing.assert_array_equal(inputs[:, 72], [0, 1, 2])
    np.testing.assert_array_equal(inputs[:, 73:75], np.tile(episode.can_pose[0, :2, 3], (3, 1)))


def test_a_robot_whose_lengths_have_another_zero_is_the_same_to_a_policy_with_a_history() -> None:
    one = made_episode(0)
    env = KengoroEnv("can_grasp")
    shift = np.linspace(-0.003, 0.003, 36)
    action = np.zeros_like(one.actions)
    lengths = 0.02 * one.lengths / 0.05 + env.bounds.to_lengths(np.zeros(36))
    action[:, :-1] = env.bounds.to_action(lengths[1:])
    one = replace(one, lengths=lengths, actions=action)
    action = action.copy()
    action[:, :-1] = env.bounds.to_action(lengths[1:] + shift)
    other = replace(one, lengths=lengths + shift, actions=action)
    (inputs, commands), (shifted, same) = examples(one, True), examples(other, True)
    np.testing.assert_allclose(commands, same, atol=1e-6)
    np.testing.assert_allclose(inputs[:, :36], shifted[:, :36], atol=1e-12)
    start = origin(other.lengths[0], history=True)
    np.testing.assert_allclose(same + start, other.actions[[9, 19, 22]], atol=1e-6)
    assert np.abs(examples(other, False)[1] - examples(one, False)[1]).max() > 0.01


def test_grasps_that_failed_are_not_cloned() -> None:
    lifted, failed = made_episode(0), made_episode(1)
    shown = [Demonstration(3, lifted), Demonstration(3, failed), Demonstration(4, failed)]
    found = clone_examples(shown, history=False)
    np.testing.assert_array_equal(found["commands"], examples(lifted, history=False)[1])
    np.testing.assert_array_equal(found["groups"], [3, 3, 3])
    with pytest.raises(ExperimentError, match="lifted in no demonstration"):
        clone_examples([Demonstration(4, failed)], history=False)


def test_a_measured_position_of_the_can_replaces_the_true_one_and_nothing_else() -> None:
    episode, measured = made_episode(0), np.array([0.41, -0.12])
    true, commands = examples(episode, history=True)
    found = clone_examples([Demonstration(0, episode, measured)], history=True)
    np.testing.assert_array_equal(found["commands"], commands)
    at = slice(2 * READ + 1, 2 * READ + 3)
    np.testing.assert_array_equal(found["inputs"][:, at], np.tile(measured, (3, 1)))
    true[:, at] = measured
    np.testing.assert_array_equal(found["inputs"], true)


def linear_episodes() -> list[Demonstration]:
    """Episodes of five robots, whose commands are linear in the can's position and the time."""
    rng = np.random.default_rng(0)
    slope = rng.normal(size=(37, 2)) * 0.3
    found = []
    for robot in range(5):
        steps = 400
        can = rng.uniform(-0.5, 0.5, 2)
        shares = np.stack([np.linspace(-1.0, 1.0, 40), np.full(40, can[0])])
        actions = np.repeat(slope @ shares, 10, axis=1).T.astype(np.float32)
        actions[:, -1] = np.where(np.arange(steps) >= 200, 1.0, -1.0)
        pose = np.eye(4)
        pose[:2, 3] = can
        lifted = np.ones(steps + 1, dtype=bool)
        own = replace(
            made_episode(0), lengths=rng.normal(size=(steps + 1, 36)),
            tensions=rng.normal(size=(steps + 1, 36)), actions=actions, rewards=np.zeros(steps),
            can_pose=np.tile(pose, (steps + 1, 1, 1)), success=lifted, grasped=lifted,
        )  # fmt: skip
        found.append(Demonstration(robot, own))
    return found


def commands_of(policy: ClonedPolicy, episode: Episode) -> np.ndarray:
    inputs, _ = examples(episode, policy.history)
    return np.array([policy(row, np.zeros(37)) for row in inputs])


def stale_policy(folder: Path) -> Path:
    """File of a policy beside other examples than those that it is to be cloned from."""
    folder.mkdir(exist_ok=True)
    (folder / "own-examples.npz").write_bytes(b"others")
    (folder / "own.npz").write_bytes(b"stale")
    return folder / "own.npz"


def test_a_policy_repeats_what_it_was_cloned_from(tmp_path: Path) -> None:
    found = linear_episodes()
    arrays = clone_examples(found, history=False)
    path = clone(stale_policy(tmp_path / "one"), arrays, Training(100))
    with np.load(path) as stored:
        losses = stored["losses"]
    assert losses.shape == (100, 2)
    assert losses[-1, 1] < 0.3 * losses[0, 1]
    policy = ClonedPolicy(path, history=False)
    episode = found[0].episode
    wanted = episode.actions[9::10]
    commands = commands_of(policy, episode)
    error = commands[:, :-1] - wanted[:, :-1]
    assert error.std() < 0.4 * wanted[:, :-1].std()
    assert np.mean(commands[:, -1] == wanted[:, -1]) > 0.9
    assert set(np.unique(commands[:, -1])) == {-1.0, 1.0}

    changed = path.stat().st_mtime_ns
    assert clone(path, arrays, Training(100)) == path
    assert path.stat().st_mtime_ns == changed  # not trained again


@pytest.mark.slow
def test_the_same_examples_clone_the_same_bits(tmp_path: Path) -> None:
    arrays = clone_examples(linear_episodes(), history=False)
    one, other = (
        clone(tmp_path / name / "own.npz", arrays, Training(30)) for name in ("one", "two")
    )
    assert one.read_bytes() == other.read_bytes()


def test_a_failed_training_is_one_sentence_and_leaves_no_policy(tmp_path: Path) -> None:
    path = stale_policy(tmp_path)
    arrays = clone_examples(linear_episodes()[:1], history=False)  # none is left to learn from
    with pytest.raises(ExperimentError, match="training of the policy 'own' failed: "):
        clone(path, arrays, Training(1))
    assert not path.exists()


def test_a_policy_that_holds_still_lifts_no_can() -> None:
    class Still(ClonedPolicy):
        def __init__(self) -> None:
            self.history, self.calls = True, 0

        def __call__(self, inputs: np.ndarray, origin: np.ndarray) -> np.ndarray:
            self.calls += 1
            assert inputs.shape == (2 * READ + EXACT,)
            return origin.astype(np.float32)

    policy = Still()
    found = lifts(policy, 3, [1, 2], 2)
    assert found == ([False, False], [True, True], [0.0, 0.0])
    assert policy.calls == 4


def given_can(arm: RowArm) -> np.ndarray:
    """What a policy is given as the can's position."""
    return arm.inputs(history=False)[READ + 1 : READ + 3]


def test_the_camera_measures_the_can_on_the_drawing() -> None:
    arm = RowArm(None, "camera")
    for seed in range(3):
        true = arm.reset(seed)["can_pose"][:2, 3]
        assert arm.can_seen
        assert 0.0 < arm.can_error < 0.005
        assert arm.can_error == np.linalg.norm(given_can(arm) - true)
        np.testing.assert_array_equal(given_can(arm), arm.can)
    arm.close()


def test_a_can_that_is_not_seen_is_in_the_middle(monkeypatch: pytest.MonkeyPatch) -> None:
    dark = np.zeros((480, 640, 3), np.uint8)
    camera = CanCamera(None)
    assert camera.position(dark) is None
    camera.close()
    monkeypatch.setattr(CanCamera, "measured", lambda self, _: self.position(dark))
    arm = RowArm(None, "camera")
    true = arm.reset(1)["can_pose"][:2, 3]
    arm.close()
    assert not arm.can_seen
    np.testing.assert_array_equal(given_can(arm), MIDDLE)
    np.testing.assert_allclose(MIDDLE, [0.40, -0.15])
    assert arm.can_error == np.linalg.norm(MIDDLE - true)


def test_the_state_renders_nothing_and_the_camera_moves_the_arm_alike() -> None:
    arms = [RowArm(None), RowArm(None, "camera")]
    for arm in arms:
        arm.reset(2)
        arm.step(arm.command)
    one, other = (np.delete(arm.inputs(True), [2 * READ + 1, 2 * READ + 2]) for arm in arms)
    np.testing.assert_array_equal(one, other)
    for arm in arms:
        arm.close()
