"""Vector environments of CanGrasp have the bits of single environments without a camera."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from kengoro.study_model import study_model
from kengoro_env.assets import asset_path
from kengoro_env.env import KengoroEnv
from kengoro_env.errors import ArgumentError, InvalidActionError
from kengoro_env.stepping import choice
from kengoro_env.stepping.numpy_steps import NumpySteps
from kengoro_env.tasks.can_grasp import CanGrasp
from kengoro_env.vector import KengoroVectorEnv
from kengoro_env.wrappers import ScaledVectorObservation
from tests.kengoro_env.environments import same

GRASP = "Kengoro/CanGrasp-v0"
COUNT = 2
BELOW_TABLE = np.array([1.2, 0.5, -0.6])
"""A position of the can's centre beside and below the table [m]."""


class Pair:
    """A vector environment, and single ones of which Gymnasium makes another.

    Attributes:
        many: the vector environment.
        info: its latest infos.
    """

    def __init__(
        self, mode: AutoresetMode = AutoresetMode.NEXT_STEP, threads: int = 2, **more: Any
    ) -> None:
        more.setdefault("robot_seed", None)
        many = gym.make_vec(GRASP, COUNT, autoreset_mode=mode, threads=threads, **more)
        assert isinstance(many, KengoroVectorEnv)
        self.many = many
        self._one_by_one: Any = gym.make_vec(
            GRASP, COUNT, "sync", {"autoreset_mode": mode}, camera=False, **more
        )
        self._singles: list[KengoroEnv] = [env.unwrapped for env in self._one_by_one.envs]
        self.info: dict[str, Any] = {}

    def reset(self, **arguments: Any) -> dict[str, Any]:
        """Reset both alike; return the observations."""
        found, expected = (
            env.reset(**copy.deepcopy(arguments)) for env in (self.many, self._one_by_one)
        )
        assert all(map(same, found, expected))
        self.info = found[1]
        return found[0]

    def step(self, actions: NDArray[np.float32]) -> Any:
        """Step both alike; return the results."""
        found, expected = self.many.step(actions), self._one_by_one.step(actions)
        for mine, theirs in zip(found, expected, strict=True):
            assert same(mine, theirs)
        self.info = found[4]
        return found

    def hold(self, lengths: NDArray[Any], fingers: float = 1.0) -> NDArray[np.float32]:
        """Actions that hold lengths (COUNT, m) [m] and command the fingers."""
        return np.stack([self._singles[0].lengths_to_action(row, fingers) for row in lengths])

    def states(self, i: int, field: str) -> tuple[NDArray[Any], NDArray[Any]]:
        """Positions or velocities of an environment ``i``, of many and of the single one."""
        fleet = self.many.fleet
        if isinstance(fleet, NumpySteps):
            return getattr(fleet._robots.data, field)[i], self._single_state(i, field)
        return getattr(fleet.parts(i)[1], field), self._single_state(i, field)

    def _single_state(self, i: int, field: str) -> NDArray[Any]:
        state: NDArray[Any] = getattr(self._singles[i].robot.data, field)
        return state

    def lay_can(self, i: int, position: NDArray[Any]) -> None:
        """Put the can of an environment to a position (3,) [m], at rest."""
        joint = self._singles[i].robot.model.joint("can")
        for position_now in self.states(i, "qpos"):
            position_now[joint.qposadr[0] :][:3] = position
        for velocity in self.states(i, "qvel"):
            velocity[joint.dofadr[0] :][:6] = 0.0

    def lay_can_into_hand(self, i: int) -> None:
        """Put the can of an environment to where the hand grips."""
        self.lay_can(i, self.info["hand_pose"][i, :3, 3])


@pytest.mark.parametrize("more", [{}, {"robot_seed": 1}], ids=["nominal", "1"])
@pytest.mark.parametrize("threads", [1, 2])
def test_they_are_single_ones_bit_for_bit(more: dict[str, Any], threads: int, kind: type) -> None:
    """Through truncations and resets, each in its own time."""
    pair = Pair(threads=threads, max_episode_steps=4, **more)
    assert type(pair.many.fleet) is kind
    rng = np.random.default_rng(0)
    pair.reset(seed=7)
    for k in range(10):
        if k == 2:  # from here on one of them is out of step with the other
            pair.reset(options={"reset_mask": np.array([False, True])})
        pair.step(rng.uniform(-1, 1, pair.many.action_space.shape).astype(np.float32))


@pytest.mark.usefixtures("kind")
@pytest.mark.parametrize("more", [{}, {"robot_seed": 1}], ids=["nominal", "1"])
def test_fingers_that_close_hold_the_can_of_one(
    more: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kengoro_env.tasks.lift_monitor.LIFT_TIME", 0.05)
    pair = Pair(**more)
    pull = pair.hold(pair.reset(seed=3)["lengths"])
    pull[1, -1] = -1.0
    lifted = []
    for k in range(12):
        if k < 8:
            pair.lay_can_into_hand(0)
        _, rewards, *_ = pair.step(pull)
        lifted.append(bool(pair.info["success"][0]))
    assert pair.info["grasped"].tolist() == [True, False]
    assert rewards[0] > 0.9 > rewards[1] > 0.0
    assert pair.info["rise"][0] > 0.1 > pair.info["rise"][1]
    assert lifted == sorted(lifted)
    assert set(lifted) == {False, True}
    assert not pair.info["success"][1]


@pytest.mark.usefixtures("kind")
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("steps", [2, 9], ids=["truncated", "not truncated"])
def test_a_can_that_falls_ends_the_episode_of_one(
    steps: int, mode: AutoresetMode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kengoro_env.tasks.can_grasp.FALLEN_TIME", 0.03)
    pair = Pair(mode, max_episode_steps=steps)
    rest = np.zeros(pair.many.action_space.shape, dtype=np.float32)
    pair.reset(seed=0)
    pair.lay_can(1, BELOW_TABLE)
    assert not pair.step(rest)[2].any()
    _, _, terminated, truncated, infos = pair.step(rest)
    assert terminated.tolist() == [False, True]
    assert truncated.tolist() == [steps == 2] * COUNT
    last = infos if mode is AutoresetMode.NEXT_STEP else infos["final_info"]
    assert last["reason"].tolist() == [None, "the can fell off the table"]
    assert last["_reason"].tolist() == [False, True]
    assert last["rise"][1] < -0.1
    *_, infos = pair.step(rest)
    assert "reason" not in infos
    assert infos["time"][1] < 0.03


@pytest.mark.usefixtures("kind")
def test_one_that_diverges_ends_alone_also_in_its_last_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("kengoro_env.tasks.lift_monitor.LIFT_TIME", 0.01)
    pair = Pair(max_episode_steps=3)
    pull = pair.hold(pair.reset(seed=3)["lengths"])
    for _ in range(2):
        pair.lay_can_into_hand(1)
        pair.step(pull)
    assert pair.info["success"].tolist() == [False, True]
    for velocity in pair.states(1, "qvel"):
        velocity[:] = np.nan
    _, rewards, terminated, truncated, infos = pair.step(pull)
    assert rewards[1] == 0.0
    assert terminated.tolist() == [False, True]
    assert truncated.all()
    assert not infos["success"].any()
    assert infos["grasped"].tolist() == [False, True]
    pair.step(pull)


COPIERS: list[Callable[[Any], Any]] = [
    copy.deepcopy,
    lambda env: cloudpickle.loads(cloudpickle.dumps(env)),
]


@pytest.mark.usefixtures("kind")
@pytest.mark.parametrize("copied", COPIERS, ids=["deepcopy", "pickle"])
def test_a_copy_continues_a_grasp_with_the_same_bits(copied: Callable[[Any], Any]) -> None:
    pair = Pair(robot_seed=1, max_episode_steps=5)
    pull = pair.hold(pair.reset(seed=3)["lengths"])
    for _ in range(3):
        pair.lay_can_into_hand(0)
        pair.step(pull)
    assert pair.info["grasped"][0]
    twin = copied(pair.many)
    for _ in range(4):  # beyond the end of the episodes
        for mine, theirs in zip(pair.step(pull), twin.step(pull), strict=True):
            assert same(mine, theirs)


@pytest.mark.usefixtures("kind")
def test_options_set_where_the_cans_stand() -> None:
    pair = Pair()
    pair.reset(seed=0, options={"can": [0.4, -0.15]})
    np.testing.assert_allclose(pair.info["can_pose"][:, :2, 3], [[0.4, -0.15]] * 2)
    pair.reset(options={"can": (0.38, -0.12), "reset_mask": np.array([False, True])})
    assert pair.info["can_pose"][1, 0, 3] == pytest.approx(0.38)
    posture = pair.info["joint_angles"][1]
    pair.reset(options={"posture": posture})
    np.testing.assert_allclose(pair.info["joint_angles"], [posture] * 2)
    with pytest.raises(ArgumentError, match=r"the can cannot stand at \(1, 1\) m"):
        pair.many.reset(options={"can": (1.0, 1.0)})


@pytest.mark.skipif(choice.library() is None, reason="there is no compiled code here")
def test_each_environment_grasps_with_its_own_model() -> None:
    """Geoms of one, and with them their numbers, may be others than those of another."""
    nominal = study_model(asset_path(CanGrasp.scene), fingers=True)
    other = nominal.copy()
    other.body("thorax").add_geom(size=[0.01] * 3, contype=0, conaffinity=0)
    other.geom("can").friction[0] *= 0.5
    singles = [KengoroEnv("can_grasp", model=model) for model in (nominal, other)]
    many: Any = gym.make_vec(GRASP, COUNT, models=[nominal, other])
    infos = many.reset(seed=[3, 3])[1]
    for env in singles:
        env.reset(seed=3)
    datas = [*(env.robot.data for env in singles), *(many.fleet.parts(i)[1] for i in range(COUNT))]
    rest = singles[0].lengths_to_action(singles[0].robot.lengths, fingers=1.0)
    for _ in range(6):
        for data in datas:
            data.joint("can").qpos[:3] = infos["hand_pose"][0, :3, 3]
        observed, rewards, _, _, infos = many.step(np.stack([rest, rest]))
        for i, env in enumerate(singles):
            one, reward, _, _, info = env.step(rest)
            assert reward == rewards[i]
            assert same({name: values[i] for name, values in observed.items()}, one)
            assert np.array_equal(info["can_pose"], infos["can_pose"][i])
            assert bool(info["grasped"]) is bool(infos["grasped"][i])
    assert infos["grasped"].all()
    assert not np.array_equal(*infos["can_pose"])


def test_it_has_no_frames_and_an_entry_for_the_fingers() -> None:
    many: Any = gym.make_vec(GRASP, COUNT)
    assert set(many.single_observation_space) == {"lengths", "tensions"}
    assert many.action_space.shape == (COUNT, 37)
    observed, infos = many.reset(seed=0)
    assert many.observation_space.contains(observed)
    assert infos["can_pose"].shape == (COUNT, 4, 4)
    wrong = np.zeros((COUNT, 37))
    with pytest.raises(InvalidActionError, match=r"a muscle and one for the fingers, got \(2, 36"):
        many.step(wrong[:, :36])
    wrong[1, 36] = 2.0
    with pytest.raises(InvalidActionError, match=r"environment 1: entry 36 .*\(fingers\) is 2"):
        many.step(wrong)
    with pytest.raises(ArgumentError, match="has no camera: leave camera out"):
        gym.make_vec(GRASP, COUNT, camera=True)


def test_scaled_observations_are_ready_for_a_network() -> None:
    scaled = ScaledVectorObservation(gym.make_vec(GRASP, COUNT, dtype=np.float32))
    observed, _ = scaled.reset(seed=0)
    assert observed.shape == (COUNT, 72)
    assert np.abs(observed).max() < 5.0
