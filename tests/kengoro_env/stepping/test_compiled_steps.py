"""Compiled control steps have the bits of NumPy's, which are used without a compiler."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from kengoro_env.departures import (
    Elongation,
    EncoderError,
    TendonStretch,
    TensionSensorError,
    actual,
)
from kengoro_env.departures.tendons import DryFriction
from kengoro_env.env import KengoroEnv
from kengoro_env.errors import InvalidActionError
from kengoro_env.robot.draft import Draft
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.stepping import choice
from kengoro_env.stepping.compiled_steps import CompiledSteps
from kengoro_env.stepping.numpy_steps import NumpySteps
from kengoro_env.stepping.tracked_object import BY_FINGERS, BY_OTHERS, BY_PALM, ObjectState
from kengoro_env.vector import KengoroVectorEnv
from tests.kengoro_env.environments import EveryOtherStretches, make

ELBOW, POSTURE, GRASP = "Kengoro/Elbow-v0", "Kengoro/Posture-v0", "Kengoro/CanGrasp-v0"
LONGER = Elongation("biceps", 0.004, time=0.03)
DUE = Elongation("biceps", 0.004, time=0.01)
REST = np.zeros(3, dtype=np.float32)


def compiled(env_id: str, **arguments: Any) -> KengoroEnv:
    env = make(env_id, **arguments)
    if not isinstance(env._steps, CompiledSteps):
        pytest.skip("there is no compiled code here")
    return env


def plain(env_id: str, **arguments: Any) -> KengoroEnv:
    """The environment stepped by NumPy."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choice, "library", lambda: None)
        env = make(env_id, **arguments)
    assert type(env._steps) is NumpySteps
    return env


def pair(env_id: str, **arguments: Any) -> tuple[KengoroEnv, KengoroEnv]:
    if env_id != ELBOW:
        arguments["camera"] = False
    return compiled(env_id, **arguments), plain(env_id, **arguments)


def assert_same(one: Any, other: Any) -> None:
    """Assert that types, shapes and bits are equal."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert set(one) == set(other)
        for name in one:
            assert_same(one[name], other[name])
    elif isinstance(one, tuple):
        for mine, theirs in zip(one, other, strict=True):
            assert_same(mine, theirs)
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.tobytes() == other.tobytes()
    else:
        assert one == other


def go(envs: tuple[KengoroEnv, KengoroEnv], steps: int, seed: int, reach: float = 1.0) -> None:
    """Step with random actions; results and states stay the same."""
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        action = rng.uniform(-reach, reach, envs[0].action_space.shape).astype(np.float32)
        assert_same(*(env.step(action.copy()) for env in envs))
    one, other = (env.robot for env in envs)
    assert_same(one.target, other.target)
    assert_same(one.read_sensors(one.measure()), other.read_sensors(other.measure()))
    for field in ("qpos", "qvel", "ctrl", "actuator_force", "qfrc_constraint"):
        assert_same(getattr(one.data, field), getattr(other.data, field))


@pytest.mark.parametrize(
    ("env_id", "more"),
    [
        (ELBOW, {}),
        (ELBOW, {"robot_seed": 3}),
        (ELBOW, {"departures": (EveryOtherStretches(), LONGER)}),
        (
            ELBOW,
            {"departures": (LONGER, DryFriction(5.0, 0.1)), "gains": Gains(2e4, 20.0, 150.0)},
        ),
        (ELBOW, {"departures": (TendonStretch(1e-5, 4e6), Elongation("triceps", 0.01))}),
        (ELBOW, {"departures": (EncoderError(offset=0.002, seed=1),)}),
        (ELBOW, {"departures": (EncoderError(noise=0.001),)}),
        (ELBOW, {"departures": (EncoderError(quantum=0.0005),)}),
        (ELBOW, {"departures": (TensionSensorError(noise=40.0),)}),
        (ELBOW, {"departures": (TensionSensorError(offset=40.0, seed=2),)}),
        (POSTURE, {}),
        (POSTURE, {"robot_seed": 1}),
        (POSTURE, {"departures": (*actual(4), Elongation("delt_mid", 0.01, time=0.05))}),
        (POSTURE, {"departures": (EveryOtherStretches(),)}),
        (GRASP, {}),
        (GRASP, {"robot_seed": 2}),
    ],
)
def test_the_bits_are_numpys(env_id: str, more: dict[str, Any]) -> None:
    envs = pair(env_id, **more)
    for seed in range(2):
        assert_same(*(env.reset(seed=seed) for env in envs))
        go(envs, 12, seed)
        for env in envs:
            env.set_stiffness(9_000.0, np.linspace(0.0, 40.0, len(env.muscles)))
        go(envs, 4, seed + 10, reach=0.1)
        for env in envs:
            env.robot.elongate(env.muscles[-1], 0.01)
        go(envs, 4, seed + 20)


def state_in_both(envs: tuple[KengoroEnv, KengoroEnv], action: np.ndarray) -> ObjectState:
    """State of the can after a control step."""
    one, other = (env._steps.step(action, None) for env in envs)
    assert_same(one, other)
    assert one.object_state is not None
    return one.object_state


def test_what_touches_the_can_is_reported_alike() -> None:
    """Fingers, palm, both, the table, none; a contact without a force does not count."""
    envs = pair(GRASP)
    for env in envs:
        env.reset(seed=0)
    can, still = envs[0].robot.model.geom("can").id, envs[0].robot.target
    touched = set()

    def lay(position: np.ndarray, fingers: float = -1.0) -> None:
        for env in envs:
            joint = env.robot.data.joint("can")
            joint.qpos[:3], joint.qvel[:] = position, 0.0
            mujoco.mj_forward(env.robot.model, env.robot.data)
        touched.add(state_in_both(envs, envs[0].lengths_to_action(still, fingers)).touched)

    on_table = envs[0].robot.data.joint("can").qpos[:3].copy()
    for _ in range(20):
        lay(on_table, fingers=1.0)
    contacts = envs[0].robot.data.contact.geom.tolist()
    assert any(can not in pair for pair in contacts)  # of the fingers with each other
    assert touched == {BY_OTHERS}
    for env in envs:
        env.robot.model.geom_gap[can] = 0.05
    lay(on_table + np.array([0.0, 0.0, 0.01]))
    assert envs[0].robot.data.ncon
    assert touched == {BY_OTHERS, 0}
    rng = np.random.default_rng(0)
    for _ in range(20):
        lay(envs[0].robot.data.site("grip").xpos + rng.uniform(-0.08, 0.08, 3))
    assert touched == {BY_OTHERS, 0, BY_FINGERS, BY_PALM, BY_FINGERS | BY_PALM}


class Cloth:
    """A cloth under the can; it is not a geom, so its index in contacts is -1."""

    def edit(self, draft: Draft) -> None:
        cloth = mujoco.MjSpec.from_string(
            "<mujoco><worldbody><flexcomp name='cloth' type='grid' dim='2' count='6 6 1' "
            "spacing='0.05 0.05 0.05' radius='0.01' rigid='true' pos='0.4 -0.15 -0.382'/>"
            "</worldbody></mujoco>"
        )
        draft.spec.attach(cloth, frame=draft.spec.worldbody.add_frame(), prefix="cloth_")


def test_what_touches_the_can_may_be_no_geom() -> None:
    envs = pair(GRASP, departures=(Cloth(),))
    for env in envs:
        env.reset(seed=0, options={"can": (0.4, -0.15)})
    state = state_in_both(envs, np.zeros(envs[0].action_space.shape))
    assert envs[0].robot.data.contact.geom.min() == -1
    assert state.touched == BY_OTHERS


@pytest.mark.parametrize("more", [{}, {"robot_seed": 1}], ids=["nominal", "actual"])
def test_targets_change_at_the_same_time(more: dict[str, Any]) -> None:
    envs = pair(ELBOW, **more)
    for env in envs:
        env.reset(seed=0)
    first = envs[0].task.goal
    go(envs, 205, 0, reach=0.2)
    assert envs[0].task.goal != first


def test_the_robot_may_be_moved_between_two_steps() -> None:
    envs = pair(ELBOW, robot_seed=2)
    for env in envs:
        env.reset(seed=0)
    go(envs, 3, 0)
    for field, value in (("qpos", 0.5), ("qvel", 2.0)):
        for env in envs:
            getattr(env.robot.data, field)[0] = value
        go(envs, 3, 1)
    for env in envs:
        env.robot.step(env.robot.target - 0.001)  # by NumPy in both
    go(envs, 3, 2)
    state = (
        [env.robot.data.qpos.copy() for env in envs],
        [env.robot.data.qvel.copy() for env in envs],
    )
    go(envs, 3, 3)
    for env, position, velocity in zip(envs, *state, strict=True):
        env.robot.data.qpos[:], env.robot.data.qvel[:] = position, velocity
    go(envs, 3, 4)


@pytest.mark.parametrize("value", [np.nan, 1e200, 1e12])
def test_both_diverge_at_the_same_time(value: float) -> None:
    envs = pair(ELBOW, robot_seed=2)
    for env in envs:
        env.reset(seed=0)
    go(envs, 2, 0)
    for env in envs:
        env.robot.data.qvel[0] = value
    results = [env.step(REST) for env in envs]
    assert_same(*results)
    assert results[0][2]
    assert_same(*(env.reset() for env in envs))
    go(envs, 3, 1)


@pytest.mark.parametrize(
    "action",
    [
        [0.1, -0.2, 0.3],
        np.array([1, 0, -1]),
        np.array([0.1, -0.2, 0.3]),
        np.array([0.1, -0.2, 0.3, 9.0, 9.0, 9.0])[:3],
        np.array([0.1, 9.0, -0.2, 9.0, 0.3], dtype=np.float32)[::2],
    ],
    ids=["list", "int", "float64", "view", "strided"],
)
def test_actions_of_many_kinds(action: Any) -> None:
    envs = pair(ELBOW)
    for env in envs:
        env.reset(seed=0)
    assert_same(*(env.step(action) for env in envs))


@pytest.mark.parametrize(
    "action",
    [
        [0.0, 0.0],
        np.float32(0.5),
        np.array([0.5]),
        np.zeros((1, 3), dtype=np.float32),
        np.zeros((3, 1), dtype=np.float32),
        np.array([0.0, np.nan, 0.0], dtype=np.float32),
        np.array([0.0, np.inf, 0.0]),
        np.array([0.0, 0.0, -1.000002]),
        np.array([0.0, None, 0.0]),
        np.array(["0.1", "up", "0.3"]),
        None,
    ],
)
@pytest.mark.parametrize("more", [{}, {"departures": (*actual(0), DUE)}], ids=["nominal", "actual"])
@pytest.mark.filterwarnings("ignore:invalid value encountered")
def test_what_is_no_action_is_refused_in_the_same_words_and_moves_nothing(
    action: Any, more: dict[str, Any]
) -> None:
    """It samples no noise and applies no event that is due."""
    envs = pair(ELBOW, **more)
    messages = []
    for env in envs:
        with pytest.raises(InvalidActionError):  # also before an episode
            env.step(action)
        env.reset(seed=0)
        env.step(REST)
        target, elongation = env.robot.target, env.robot.motors.elongation
        noise = env.robot.random.bit_generator.state
        with pytest.raises(InvalidActionError) as refused:
            env.step(action)
        messages.append(str(refused.value))
        assert env.robot.time == pytest.approx(0.02)
        assert np.array_equal(env.robot.target, target)
        assert np.array_equal(env.robot.motors.elongation, elongation)
        assert env.robot.random.bit_generator.state == noise
    assert messages[0] == messages[1]
    go(envs, 3, 0)


@pytest.mark.parametrize("more", [{}, {"robot_seed": 1}], ids=["nominal", "actual"])
def test_an_error_of_mujoco_is_raised_as_its_bindings_do(more: dict[str, Any]) -> None:
    envs = pair(ELBOW, **more)
    for _ in range(2):
        messages = []
        for env in envs:
            env.reset(seed=0)
            env.robot.model.opt.integrator = 99
            with pytest.raises(mujoco.FatalError) as broken:
                env.step(REST)
            messages.append(str(broken.value))
            env.robot.model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        assert messages == ["mj_step: invalid integrator"] * 2
        go(envs, 3, 0)
    envs[0].robot.model.opt.integrator = 99
    with pytest.raises(mujoco.FatalError, match="invalid integrator"):  # as before by the bindings
        mujoco.mj_step(envs[0].robot.model, envs[0].robot.data)


def test_errors_of_mujoco_in_many_threads_at_once() -> None:
    many = KengoroVectorEnv(40, "elbow", robot_seed=1, threads=4)
    if not isinstance(many.fleet, CompiledSteps):
        pytest.skip("there is no compiled code here")
    for _ in range(20):
        many.reset(seed=0)
        for i in range(40):
            many.fleet.parts(i)[0].opt.integrator = 99
        with pytest.raises(mujoco.FatalError, match="mj_step: invalid integrator"):
            many.step(np.tile(REST, (40, 1)))


def test_an_error_of_mujoco_in_one_of_many_is_raised() -> None:
    many = KengoroVectorEnv(5, "elbow", robot_seed=1, threads=3)
    if not isinstance(many.fleet, CompiledSteps):
        pytest.skip("there is no compiled code here")
    rest = np.zeros((5, 3), dtype=np.float32)
    many.reset(seed=0)
    many.fleet.parts(3)[0].opt.integrator = 99
    with pytest.raises(mujoco.FatalError, match="integrator"):
        many.step(rest)
    many.fleet.parts(3)[0].opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    many.reset(seed=0)
    assert many.step(rest)[4]["time"] == pytest.approx([0.02] * 5)
