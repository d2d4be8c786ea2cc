"""The environments follow Gymnasium's interface; errors are one sentence."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from kengoro_env.departures import Elongation, HeatingMotors, TendonStretch, actual
from kengoro_env.env import KengoroEnv
from kengoro_env.errors import ArgumentError, EpisodeError, InvalidActionError, KengoroError
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.vision.rendering import Painter
from tests.kengoro_env.environments import make

IDS = ("Kengoro/CanGrasp-v0", "Kengoro/Posture-v0", "Kengoro/Elbow-v0")
COMMON = {
    "joint_angles",
    "hand_pose",
    "success",
    "time",
    "slack_paid_out",
    "slack_target",
}


@pytest.mark.parametrize("robot_seed", [None, 5])
@pytest.mark.parametrize("env_id", IDS)
def test_gymnasiums_checker_finds_nothing(
    env_id: str, robot_seed: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    env = make(env_id, robot_seed=robot_seed, camera=None)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env)
    env.close()
    # One render mode is "human", and without a display that is worth a warning.
    assert [w for w in caught if "opens no window" not in str(w.message)] == []
    assert len(caught) == 1


@pytest.mark.parametrize(
    ("env_id", "entries"),
    [
        ("Kengoro/CanGrasp-v0", {"lengths", "tensions", "frame", "frame_time"}),
        ("Kengoro/Posture-v0", {"lengths", "tensions", "frame", "frame_time", "target"}),
        ("Kengoro/Elbow-v0", {"lengths", "tensions", "target"}),
    ],
)
def test_no_observation_is_constant(env_id: str, entries: set[str]) -> None:
    env = gym.make(env_id, robot_seed=1, camera=None)
    assert isinstance(env.observation_space, gym.spaces.Dict)
    assert set(env.observation_space.spaces) == entries
    first, _ = env.reset(seed=0)
    env.action_space.seed(0)
    changed = {name: np.zeros(value.shape, bool) for name, value in first.items()}
    for _ in range(220):
        observation, reward, terminated, _, _ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        assert type(reward) is float
        assert np.isfinite(reward)
        assert -1.0 <= reward <= 1.0
        for name, value in observation.items():
            changed[name] |= value != first[name]
        if terminated:  # the can may be knocked off the table
            break
    env.close()
    for name, value in changed.items():
        assert value.any() if name == "frame" else value.all(), name


@pytest.mark.parametrize(
    ("env_id", "frames"), [(IDS[0], True), (IDS[1], False), (IDS[2], False)], ids=IDS
)
def test_frames_are_observed_by_default_only_where_nothing_else_shows_the_object(
    env_id: str, frames: bool
) -> None:
    """As by `gymnasium.make_vec`, which has no camera; a can is seen in frames alone."""
    env = gym.make(env_id)
    env.close()
    assert isinstance(env.observation_space, gym.spaces.Dict)
    assert ({"frame", "frame_time"} <= set(env.observation_space)) == frames


@pytest.mark.parametrize("env_id", IDS)
def test_info_and_shapes(env_id: str) -> None:
    env = make(env_id, camera=False)
    observation, info = env.reset(seed=0)
    assert set(observation) == set(env.observation_space.spaces)
    assert "frame" not in observation
    extra = {"can_pose", "grasped", "rise"} if "Can" in env_id else set()
    assert set(info) == COMMON | extra
    joints = env.robot.data.qpos[[env.robot.model.joint(j).qposadr[0] for j in env.joints]]
    assert np.array_equal(info["joint_angles"], joints)
    grip = env.robot.data.site("grip")
    assert np.array_equal(info["hand_pose"][:3, 3], grip.xpos)
    assert np.array_equal(info["hand_pose"][:3, :3].ravel(), grip.xmat)
    assert np.array_equal(info["hand_pose"][3], [0, 0, 0, 1])
    *_, info = env.step(env.lengths_to_action(observation["lengths"]))
    assert info["time"] == pytest.approx(0.02)
    env.close()


def test_numbers_of_entries() -> None:
    can, posture, elbow = (make(env_id, camera=False) for env_id in IDS)
    assert (len(posture.muscles), len(posture.joints)) == (36, 14)
    assert posture.action_space.shape == (36,)
    assert can.action_space.shape == (37,)
    assert (elbow.muscles, elbow.joints) == (("biceps", "brachialis", "triceps"), ("elbow",))


def test_time_limits() -> None:
    for env_id, most in zip(IDS, (20_000, 1000, 1000), strict=True):
        spec = gym.spec(env_id)
        assert spec.max_episode_steps == most
    env = gym.make("Kengoro/Elbow-v0")
    observation, _ = env.reset(seed=0)
    action = env.unwrapped.lengths_to_action(observation["lengths"])
    steps, truncated = 0, False
    while not truncated:
        _, _, terminated, truncated, _ = env.step(action)
        steps += 1
        assert not terminated
    assert steps == 1000


class TensorWithGradient:
    """Refuses to become an array, as tensors of PyTorch that have a gradient."""

    def __array__(self, dtype: object = None, copy: object = None) -> None:
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.")

    def __repr__(self) -> str:
        return "tensor"


@pytest.mark.parametrize(
    ("action", "sentence"),
    [
        (np.zeros(2), r"shape \(3,\).*got \(2,\)"),
        (np.zeros((3, 1)), r"shape \(3,\).*got \(3, 1\)"),
        (0.0, r"shape \(3,\)"),
        ([0, np.nan, 0], r"entry 1 of the action \(brachialis\) is nan"),
        ([0, 0, np.inf], r"entry 2 of the action \(triceps\) is inf"),
        ([-1.01, 0, 0], r"entry 0 of the action \(biceps\) is -1.01"),
        ("pull", r"3 real numbers within \[-1, 1\]"),
        (None, "action"),
        ([0, "x", 0], "3 real numbers"),
        (np.zeros(3, dtype=complex), r"3 real numbers.*got a ndarray of complex128$"),
        (np.ma.masked_array(np.zeros(3), [1, 0, 0]), r"real.*got a MaskedArray of float64$"),
        (np.zeros(3, dtype="timedelta64[s]"), "3 real numbers"),
        ([0, np.ma.masked_array([0.0]), 0], "3 real numbers"),
        (np.array([0, 1j, 0], dtype=object), r"3 real numbers.*got a ndarray of object$"),
        (["0", "0", "0"], r"3 real numbers.*got \['0', '0', '0'\]$"),
        (np.array(["0", "0", "0"]), "3 real numbers"),
        (np.zeros(3, dtype=object), "3 real numbers.*got a ndarray of object$"),
        (np.zeros(3, dtype=bool), "3 real numbers.*got a ndarray of bool$"),
        ([0.5, True, 0.5], "3 real numbers"),
        ((0.5, np.True_, 0.5), "3 real numbers"),
        (TensorWithGradient(), "3 real numbers"),
        ([0, 1.00001, 0], r"entry 1 of the action \(brachialis\) is 1\.00001: "),
        (np.array([0, 0, -1.00001], dtype=np.float32), r"\(triceps\) is -1\.0000"),
    ],
)
def test_a_bad_action_is_named(action: Any, sentence: str) -> None:
    env = make("Kengoro/Elbow-v0")
    env.reset(seed=0)
    with pytest.raises(InvalidActionError, match=sentence):
        env.step(action)
    before = env.robot.time
    env.step(np.zeros(3))
    assert env.robot.time > before


@pytest.mark.parametrize("kind", [float, np.float32])
def test_what_rounding_takes_beyond_one_commands_what_one_does(kind: type) -> None:
    bits = []
    for largest in (1.0, 1.0000001, 1.0 + 9e-7):
        env = make("Kengoro/Elbow-v0")
        env.reset(seed=0)
        action = np.array([largest, 0.0, -largest], dtype=kind)
        lengths = [env.step(action)[0]["lengths"], env.robot.target, env.action_to_lengths(action)]
        bits.append(np.stack(lengths))
        assert np.array_equal(lengths[1], lengths[2])
    assert np.array_equal(bits[0], bits[1])
    assert np.array_equal(bits[0], bits[2])


@pytest.mark.parametrize("env_id", IDS)
def test_info_holds_arrays_and_numbers_of_numpy_of_the_same_types(env_id: str) -> None:
    """Learning libraries read the dtypes from a first step."""
    env = make(env_id)
    _, first = env.reset(seed=0)
    *_, later = env.step(np.zeros(env.action_space.shape))
    for info in (first, later):
        assert set(info) == set(first)
        for name, value in info.items():
            assert isinstance(value, np.ndarray | np.float64), name
            assert (value.dtype, value.shape) == (first[name].dtype, first[name].shape)
    assert (first["success"].dtype, first["time"].dtype) == (np.bool_, np.float64)


def test_a_bad_entry_for_the_fingers_is_named() -> None:
    env = make("Kengoro/CanGrasp-v0", camera=False)
    env.reset(seed=0)
    with pytest.raises(InvalidActionError, match=r"entry 36 of the action \(fingers\) is 2"):
        env.step(np.append(np.zeros(36), 2.0))
    with pytest.raises(InvalidActionError, match="one for the fingers"):
        env.step(np.zeros(36))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"postur": [0.0]}, "unknown option 'postur'; known: posture, target"),
        ({"can": [0.4, 0.0]}, "unknown option 'can'"),
        ({"posture": [0.0, 0.0]}, "'posture' must be 1 finite number in a list"),
        ({"posture": [np.nan]}, "'posture' must be 1 finite number in a list"),
        ({"posture": ["0.5"]}, "'posture' must be 1 finite number in a list"),
        ({"posture": [True]}, "'posture' must be 1 finite number in a list"),
        ({"target": "up"}, "'target' must be 1 finite number in a list"),
        ({"target": [3.0]}, r"'target' puts elbow at 3.000 rad: it must be within 0.000 and 2.09"),
    ],
)
def test_a_bad_option_is_named(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(KengoroError, match=sentence):
        make("Kengoro/Elbow-v0").reset(options=options)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"robot_seed": 1, "departures": ()}, "either robot_seed or departures"),
        ({"robot_seed": "x"}, "robot_seed must be a whole number or None, got 'x'"),
        ({"robot_seed": -1}, "robot_seed must not be negative"),
        ({"departures": ("stretch",)}, "unknown departure 'stretch'; known: Attachment"),
        ({"departures": TendonStretch(1e-5)}, "tuple of departures"),
        ({"departures": (TendonStretch,)}, "unknown departure <class"),
        ({"departures": (Elongation("bisceps", 0.1),)}, "unknown muscle 'bisceps'; known: bic"),
        ({"camera": True}, "'elbow' has no camera"),
        ({"render_mode": "ascii"}, "unknown render_mode 'ascii'; known: human"),
        ({"camera_name": "ear"}, "unknown camera_name 'ear'; known: outside"),
        ({"dtype": np.float16}, "dtype must be numpy.float64 or numpy.float32, got <class 'num"),
        ({"dtype": "single?"}, "dtype must be numpy.float64 or numpy.float32, got 'single"),
        ({"dtype": None}, "dtype must be numpy.float64 or numpy.float32, got None"),
        ({"width": 0}, "width must be from 1 to 4096, got 0"),
        ({"height": 4.5}, "height must be a whole number, from 1 to 4096, got 4.5"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*render_mode")
def test_a_bad_argument_is_named(arguments: dict[str, Any], sentence: str) -> None:
    with pytest.raises(KengoroError, match=sentence):
        gym.make("Kengoro/Elbow-v0", **arguments)


def test_unknown_names() -> None:
    with pytest.raises(KengoroError, match="unknown task 'walk'; known: can_grasp, posture"):
        KengoroEnv("walk")
    with pytest.raises(TypeError, match="gainz"):
        gym.make("Kengoro/Elbow-v0", gainz=Gains())


def test_robot_seed_is_the_actual_robot_of_that_seed() -> None:
    seeded = make("Kengoro/Elbow-v0", robot_seed=7)
    listed = make("Kengoro/Elbow-v0", departures=actual(7))
    nominal = make("Kengoro/Elbow-v0")
    results = []
    for env in (seeded, listed, nominal):
        env.reset(seed=0, options={"posture": [0.5]})
        for _ in range(20):
            observation, *_ = env.step(np.array([0.2, 0.1, 0.0]))
        results.append(observation["lengths"])
    assert np.array_equal(results[0], results[1])
    assert not np.allclose(results[0], results[2], atol=1e-4)


def test_stepping_without_an_episode() -> None:
    env = make("Kengoro/Elbow-v0")
    with pytest.raises(KengoroError, match=r"no episode to step \(none has begun\): call reset"):
        env.step(np.zeros(3))


def test_what_a_user_does_to_observations_and_info_does_not_reach_the_simulation() -> None:
    def run(spoil: bool) -> list[np.ndarray]:
        env = make("Kengoro/Posture-v0", robot_seed=2, camera=True)
        observation, info = env.reset(seed=0)
        seen = []
        action = env.action_space.sample() * 0
        for _ in range(15):
            if spoil:
                for value in [*observation.values(), *info.values()]:
                    if isinstance(value, np.ndarray):
                        value[...] = 0
            observation, _, _, _, info = env.step(action)
            seen += [v.copy() for v in [*observation.values(), info["joint_angles"]]]
        env.close()
        return seen

    for kept, spoilt in zip(run(False), run(True), strict=True):
        assert np.array_equal(kept, spoilt)


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("dtype", [np.float32, "float32", np.dtype(np.float32)])
def test_observations_of_single_precision_are_those_of_double_rounded(
    env_id: str, dtype: Any
) -> None:
    heating = (HeatingMotors(heat=4e-4, seed=1),)
    single, double = (
        make(env_id, departures=heating, camera=None, **more) for more in ({"dtype": dtype}, {})
    )
    assert isinstance(single.observation_space, gym.spaces.Dict)
    for name, space in single.observation_space.spaces.items():
        assert space.dtype == (np.uint8 if name == "frame" else np.float32)
    found, expected = single.reset(seed=0), double.reset(seed=0)
    for step in range(6):
        assert single.observation_space.contains(found[0])
        for name, value in found[0].items():
            assert value.dtype == single.observation_space[name].dtype
            assert np.array_equal(value, expected[0][name].astype(value.dtype))
        for name, value in expected[-1].items():
            assert np.array_equal(found[-1][name], value)
            assert found[-1][name].dtype == value.dtype
        action = np.full(single.action_space.shape, (-1.0) ** step)
        found, expected = single.step(action), double.step(action)  # type: ignore[assignment]
        assert found[1] == expected[1]  # type: ignore[comparison-overlap]
    single.close()
    double.close()


def test_readings_at_their_bounds_are_within_spaces_of_single_precision() -> None:
    env = make("Kengoro/Elbow-v0", departures=(Elongation("biceps", 0.5, 0.02),), dtype=np.float32)
    env.reset(seed=0)
    for _ in range(3):
        observation, *_ = env.step(np.zeros(3))
    space = env.observation_space["lengths"]
    assert observation["lengths"][0] in (space.low[0], space.high[0])
    assert env.observation_space.contains(observation)


@pytest.mark.parametrize("value", [np.nan, 1e12])
def test_divergence_ends_the_episode(value: float) -> None:
    env = make("Kengoro/Elbow-v0", robot_seed=1)
    env.reset(seed=0)
    before, _, _, _, info_before = env.step(np.zeros(3))
    env.robot.data.qvel[:] = value
    observation, reward, terminated, truncated, info = env.step(np.zeros(3))
    assert (terminated, truncated) == (True, False)
    assert "diverged" in info["reason"]
    assert info["success"].shape == ()
    assert not info["success"]
    assert np.isfinite(reward)
    for name, entry in observation.items():
        assert np.array_equal(entry, before[name])
    assert np.array_equal(info["joint_angles"], info_before["joint_angles"])
    assert env.observation_space.contains(observation)
    with pytest.raises(KengoroError, match=r"diverged.*call reset"):
        env.step(np.zeros(3))
    again, _ = env.reset(seed=3)
    fresh, _ = make("Kengoro/Elbow-v0", robot_seed=1).reset(seed=3)
    assert all(np.array_equal(again[name], fresh[name]) for name in fresh)


def test_sensors_saturate_at_their_bounds() -> None:
    env = make("Kengoro/Elbow-v0", departures=(Elongation("biceps", 0.5, time=0.02),))
    env.reset(seed=0)
    for _ in range(3):
        observation, *_ = env.step(np.zeros(3))
    space = env.observation_space["lengths"]
    assert observation["lengths"][0] in (space.low[0], space.high[0])
    assert space.contains(observation["lengths"])


def test_stiffness_at_run_time() -> None:
    env = make("Kengoro/Elbow-v0")
    sag = []
    for stiffness in (5_000.0, 50_000.0):
        observation, _ = env.reset(seed=0, options={"posture": [1.2]})
        env.set_stiffness(np.full(3, stiffness), 20.0)
        action = env.lengths_to_action(observation["lengths"])
        for _ in range(100):
            *_, info = env.step(action)
        sag.append(abs(info["joint_angles"][0] - 1.2))
    assert sag[1] < 0.5 * sag[0]
    for bad in (-1.0, np.nan, np.ones(2), "stiff"):
        with pytest.raises(KengoroError, match="set_stiffness: stiffness must be finite"):
            env.set_stiffness(bad, 20.0)
    with pytest.raises(KengoroError, match="bias must be at most T_max"):
        env.set_stiffness(1e4, 1e4)


@pytest.mark.parametrize("name", ["stiffness", "bias", "limit", "damping"])
@pytest.mark.parametrize("value", [np.inf, np.nan, -1.0, "30", True, None])
def test_bad_gains_are_refused(name: str, value: Any) -> None:
    with pytest.raises(ArgumentError, match=f"^Gains: {name} must be a finite number"):
        Gains(**{name: value})


def test_gains_are_those_after_each_reset() -> None:
    env = make("Kengoro/Elbow-v0", gains=Gains(stiffness=3_000.0, bias=11.0))
    env.reset(seed=0)
    env.set_stiffness(9_000.0, 12.0)
    env.reset(seed=0)
    assert np.all(env.robot.motors.stiffness == 3_000.0)
    assert np.all(env.robot.motors.bias == 11.0)


def test_render_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert make("Kengoro/Elbow-v0").render() is None
    env = make("Kengoro/Elbow-v0", render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture is not None
    assert (picture.shape, picture.dtype) == ((480, 640, 3), np.uint8)
    assert picture.std() > 5.0
    env.close()
    env.close()


@pytest.mark.parametrize("mode", ["rgb_array", "depth_array", "human"])
def test_nothing_is_rendered_before_a_reset(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As Gymnasium's OrderEnforcing says of the environments that `gymnasium.make` creates."""
    monkeypatch.setattr("kengoro_env.env.open_window", lambda *_: pytest.fail("it was opened"))
    env = make("Kengoro/Elbow-v0", render_mode=mode)
    with pytest.raises(EpisodeError, match=r"no episode to render \(none has begun\): call reset"):
        env.render()
    with pytest.raises(gym.error.ResetNeeded):
        gym.make("Kengoro/Elbow-v0", render_mode=mode).render()


def test_the_end_of_an_episode_can_be_rendered() -> None:
    env = make("Kengoro/Elbow-v0", render_mode="rgb_array", width=64, height=48)
    env.reset(seed=0)
    env.robot.data.qpos[:] = np.nan
    assert env.step(np.zeros(3, dtype=np.float32))[2]
    picture = env.render()
    assert picture is not None
    env.close()


def test_pictures_have_the_size_and_the_camera_that_are_asked_for() -> None:
    """By the keywords of Gymnasium's MuJoCo environments."""
    pictures = []
    for camera_name in ("outside", None, "eye"):
        options = {"width": 96, "height": 64, "camera_name": camera_name}
        env = make("Kengoro/Posture-v0", render_mode="rgb_array", **options)
        env.reset(seed=0)
        picture = env.render()
        assert picture is not None
        assert (picture.shape, picture.dtype) == ((64, 96, 3), np.uint8)
        assert picture.std() > 5.0
        pictures.append(picture)
        env.close()
    assert np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(pictures[0], pictures[2])


def test_depths_are_distances_from_the_camera() -> None:
    """The hand's depth is its distance along the axis of the camera, up to its thickness."""
    env = make("Kengoro/Elbow-v0", render_mode="depth_array", width=320, height=240)
    env.reset(seed=0, options={"posture": [1.2]})
    depths = env.render()
    assert depths is not None
    assert (depths.shape, depths.dtype) == ((240, 320), np.float32)
    camera, model = env.robot.data.camera("outside"), env.robot.model
    axes, hand = camera.xmat.reshape(3, 3), env.robot.data.site("grip").xpos
    x, y, z = axes.T @ (hand - camera.xpos)
    focal = 0.5 * 240 / np.tan(np.radians(model.camera("outside").fovy[0]) / 2)
    column, row = round(159.5 + focal * x / -z), round(119.5 - focal * y / -z)
    assert depths[row, column] == pytest.approx(-z, abs=0.06)
    assert depths.max() == pytest.approx(env._painter.farthest, rel=0.01)
    assert np.array_equal(depths, env.render())
    env.close()


def test_human_without_a_display_warns_once_and_draws_offscreen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    env = make("Kengoro/Elbow-v0", render_mode="human")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env.reset(seed=0)
        env.step(np.zeros(3))
        picture = env.render()
    assert ["opens no window" in str(w.message) for w in caught] == [True]
    assert picture is not None
    env.close()


def test_human_with_a_display_shows_each_step(monkeypatch: pytest.MonkeyPatch) -> None:
    class Window:
        shown = closed = 0

        def sync(self) -> None:
            self.shown += 1

        def close(self) -> None:
            self.closed += 1

    window = Window()
    monkeypatch.setattr("kengoro_env.env.open_window", lambda model, data: window)
    env = make("Kengoro/Elbow-v0", render_mode="human")
    env.reset(seed=0)
    env.step(np.zeros(3))
    assert env.render() is None
    env.close()
    assert (window.shown, window.closed) == (3, 1)


def test_closing_frees_what_draws_for_the_robot_and_for_people() -> None:
    env = make("Kengoro/Posture-v0", camera=True, render_mode="rgb_array")
    first, _ = env.reset(seed=0)
    env.render()
    assert env._camera is not None
    painters = env._painter, env._camera._painter
    assert all(painter._renderer is not None for painter in painters)
    env.close()
    assert all(painter._renderer is None for painter in painters)
    again, _ = env.reset(seed=0)
    assert np.array_equal(first["frame"], again["frame"])
    env.close()


def test_a_closed_painter_draws_again() -> None:
    env = make("Kengoro/Elbow-v0")
    env.reset(seed=0)
    painter = Painter(env.robot.model)
    first = painter.draw(env.robot.data, "outside")
    painter.close()
    assert np.array_equal(first, painter.draw(env.robot.data, "outside"))
    painter.close()


@pytest.mark.parametrize("camera", ["no", "yes", 1, 1.5, [], np.ones(2)])
def test_a_camera_is_wanted_or_not(camera: object) -> None:
    with pytest.raises(ArgumentError, match="must be True, False or None"):
        gym.make("kengoro_env:Kengoro/Posture-v0", camera=camera)
