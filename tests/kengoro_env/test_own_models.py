"""Models of a user, one for each environment of a vector: they move as MuJoCo moves them."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import kengoro_env
from kengoro.study_model import study_model
from kengoro_env.assets import asset_path
from kengoro_env.env import KengoroEnv
from kengoro_env.errors import ArgumentError, KengoroError
from kengoro_env.vector import KengoroVectorEnv
from kengoro_env.wrappers import ScaledObservation

ID = "Kengoro/Elbow-v0"
SCENE = "mjcf/kengoro_arm/elbow.xml"
CAN_SCENE = "mjcf/kengoro_arm/can_grasp.xml"


@pytest.fixture(scope="module")
def nominal() -> mujoco.MjSpec:
    """The nominal model with its tendons and motors, as in a study."""
    return study_model(asset_path(SCENE))


def changed(nominal: mujoco.MjSpec, stiffer: float = 1.0, heavier: float = 1.0) -> mujoco.MjSpec:
    """The model with other gains and masses."""
    spec = nominal.copy()
    for actuator in spec.actuators:
        actuator.gainprm[0] *= stiffer
        actuator.biasprm[1] *= stiffer
    for geom in spec.geoms:
        geom.mass *= heavier  # not a number where the density counts
        geom.density *= heavier
    for body in spec.bodies:
        body.mass *= heavier
        body.inertia *= heavier
    return spec


@dataclass(frozen=True)
class Sample:
    """Such as an extended model of `reality_gap`."""

    spec: mujoco.MjSpec


def make(**options: Any) -> KengoroEnv:
    env = gym.make(ID, camera=False, **options).unwrapped
    assert isinstance(env, KengoroEnv)
    return env


def make_many(count: int, **options: Any) -> KengoroVectorEnv:
    envs = gym.make_vec(ID, count, threads=1, **options)
    assert isinstance(envs, KengoroVectorEnv)
    return envs


def limited(nominal: mujoco.MjSpec, low: float, high: float) -> mujoco.MjSpec:
    """The model with another range of its elbow [deg]."""
    spec = nominal.copy()
    spec.joint("elbow").range = [low, high]
    spec.compile()
    return spec


@pytest.mark.parametrize("limits", [(0.0, 45.0), (30.0, 60.0), (-20.0, 120.0), (105.0, 119.0)])
def test_starts_and_targets_are_within_the_joint_range_of_a_model(
    nominal: mujoco.MjSpec, limits: tuple[float, float]
) -> None:
    """105 to 119 deg: beyond all angles that are sampled otherwise."""
    env = make(model=limited(nominal, *limits))
    check_env(env, skip_render_check=True)
    scaled = ScaledObservation(env)
    low, high = np.radians(limits)
    for seed in range(20):
        observed, info = scaled.reset(seed=seed)
        assert low - 1e-9 <= info["joint_angles"][0] <= high + 1e-9
        assert np.abs(observed[-4]) <= 1.0 + 1e-6  # lengths, target, tensions
        target = env.task.goal
        env.reset(options={"target": target, "posture": target})
    for _ in range(5):
        env.task.next_target()
        assert low <= env.task.goal[0] <= high


def test_targets_of_each_model_of_a_vector_are_within_its_range(nominal: mujoco.MjSpec) -> None:
    models = [limited(nominal, 0.0, 45.0), limited(nominal, 60.0, 110.0)]
    envs = make_many(2, models=models)
    seen = []
    for seed in range(20):
        observed, _ = envs.reset(seed=seed)
        assert envs.observation_space.contains(observed)
        seen.append(np.degrees(observed["target"][:, 0]))
    assert np.max(seen, axis=0)[0] <= 45.0
    assert np.min(seen, axis=0)[1] >= 60.0


def test_targets_of_a_model_with_the_range_of_the_scene_are_those_without_a_model(
    nominal: mujoco.MjSpec,
) -> None:
    targets = [make(**one).reset(seed=5)[0]["target"] for one in ({}, {"model": nominal})]
    np.testing.assert_array_equal(*targets)


def test_a_model_without_a_joint_range_is_refused(nominal: mujoco.MjSpec) -> None:
    spec = nominal.copy()
    spec.joint("elbow").limited = mujoco.mjtLimited.mjLIMITED_FALSE
    spec.joint("elbow").range = [0.0, 0.0]
    with pytest.raises(ArgumentError, match=r"the joint 'elbow' of model must have a range"):
        make(model=spec)


def test_the_nominal_model_as_a_model_moves_as_without_it(nominal: mujoco.MjSpec) -> None:
    angles = []
    for env in (make(), make(model=Sample(nominal))):
        env.reset(seed=3)
        actions = np.random.default_rng(0).uniform(-0.3, 0.3, (5, len(env.muscles)))
        for action in actions.astype(np.float32):
            observed, _, _, _, info = env.step(action)
        angles.append((info["joint_angles"], observed["lengths"], observed["tensions"]))

    for one, two in zip(*angles, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-6, atol=1e-6)


def test_the_nominal_model_of_the_can_as_a_model_grasps_as_without_it() -> None:
    """The fingers close, and the can is known."""
    nominal = study_model(asset_path(CAN_SCENE), fingers=True)
    found = []
    for env in (KengoroEnv("can_grasp"), KengoroEnv("can_grasp", model=nominal)):
        observed, _ = env.reset(seed=3)
        opened = env.robot.data.joint("finger_proximal").qpos[0]
        action = env.lengths_to_action(observed["lengths"] - 0.001, fingers=1.0)
        for _ in range(20):
            observed, reward, _, _, info = env.step(action)
        closed = env.robot.data.joint("finger_proximal").qpos[0]
        assert closed - opened > 0.5
        found.append((observed["lengths"], observed["tensions"], info["can_pose"], reward, closed))
    for one, two in zip(*found, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-5, atol=1e-6)


def without(kind: str, name: str) -> Callable[[mujoco.MjSpec], mujoco.MjSpec]:
    def change(spec: mujoco.MjSpec) -> mujoco.MjSpec:
        spec.delete(getattr(spec, kind)(name))
        return spec

    return change


def with_fixed_can(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    spec.joint("can").type = mujoco.mjtJoint.mjJNT_BALL
    return spec


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (without("actuator", "fingers"), "model has no actuator 'fingers', which the task needs"),
        (without("body", "can"), "model has no body 'can', which the task needs"),
        (without("site", "marker_can"), "model has no site 'marker_can', which the task needs"),
        (with_fixed_can, "the joint 'can' of model must be free"),
    ],
)
def test_a_model_without_what_grasping_needs_is_refused(change: Any, sentence: str) -> None:
    spec = change(study_model(asset_path(CAN_SCENE), fingers=True))
    with pytest.raises(ArgumentError, match=sentence):
        KengoroEnv("can_grasp", model=spec)


def test_a_model_of_the_can_has_no_frames() -> None:
    spec = study_model(asset_path(CAN_SCENE), fingers=True)
    with pytest.raises(ArgumentError, match="has no frames: give camera=False"):
        gym.make("Kengoro/CanGrasp-v0", model=spec, camera=True)
    env = gym.make("Kengoro/CanGrasp-v0", model=spec)
    assert "frame" not in env.observation_space.spaces  # type: ignore[attr-defined]


def test_a_model_moves_as_mujoco_moves_it(nominal: mujoco.MjSpec) -> None:
    """Also with an encoder that the model's servos read wrongly, and with other gains."""
    spec = changed(nominal, stiffer=0.8, heavier=1.3)
    muscle = spec.actuators[0].name
    spec.actuator(muscle).biasprm[0] += 60.0
    env = make(model=spec)
    env.reset(seed=1)
    model = spec.compile()
    assert model.body_subtreemass[0] > 1.2 * nominal.compile().body_subtreemass[0]
    data = mujoco.MjData(model)
    zero = nominal.compile().tendon_length0
    action = env.lengths_to_action(env.robot.lengths).astype(np.float32)
    mujoco.mj_setState(model, data, env.robot.state().physics, mujoco.mjtState.mjSTATE_INTEGRATION)
    target = env.action_to_lengths(action)
    for name, length in zip(env.muscles, target, strict=True):
        data.ctrl[model.actuator(name).id] = length + zero[model.tendon(name).id]

    for _ in range(5):
        *_, info = env.step(action)
    steps = round(5 * env.robot.control_period / model.opt.timestep)
    mujoco.mj_step(model, data, steps)

    joints = [model.joint(joint).qposadr[0] for joint in env.joints]
    np.testing.assert_allclose(info["joint_angles"], data.qpos[joints], atol=1e-9)


def test_each_environment_of_a_vector_has_its_model(nominal: mujoco.MjSpec) -> None:
    """The bits are those of single environments with these models."""
    models = [nominal, changed(nominal, heavier=1.5), changed(nominal, stiffer=0.7)]
    envs = make_many(3, models=models, max_episode_steps=2)
    observed, _ = envs.reset(seed=[5, 5, 5])
    pull = make().lengths_to_action(observed["lengths"][0] - 0.003)
    action = np.tile(pull, (3, 1))
    angles = envs.step(action)[4]["joint_angles"]
    assert len({tuple(row) for row in angles}) == 3
    for _ in range(3):  # the second resets
        observed, rewards, _, _, _ = envs.step(action)

    singles = []
    for model in models:
        env = make(model=model)
        env.reset(seed=5)
        for _ in range(2):
            env.step(action[0])
        env.reset()
        singles.append(env.step(action[0]))
    np.testing.assert_array_equal(observed["lengths"], [one[0]["lengths"] for one in singles])
    np.testing.assert_array_equal(rewards, [one[1] for one in singles])
    again = copy.deepcopy(envs)
    for one, two in zip(again.step(action)[:2], envs.step(action)[:2], strict=True):
        np.testing.assert_equal(one, two)


def without_muscle(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    spec.delete(spec.actuators[0])
    return spec


def with_velocity_gain(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    spec.actuators[1].biasprm[2] = -5.0
    return spec


def with_free_forces(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    spec.actuators[0].forcelimited = False
    return spec


def test_a_model_without_cameras_is_not_rendered(nominal: mujoco.MjSpec) -> None:
    spec = nominal.copy()
    spec.geom("marker_plate").group = 3  # as all others of a study's model
    with pytest.raises(ArgumentError, match="nothing of the model is rendered"):
        make(model=spec, render_mode="rgb_array")
    spec.worldbody.add_geom(size=[0.1] * 3)
    for camera in list(spec.cameras):
        spec.delete(camera)
    make(model=spec)
    with pytest.raises(ArgumentError, match="has no camera 'outside': leave render_mode out"):
        make(model=spec, render_mode="rgb_array")
    with pytest.raises(ArgumentError, match="has no camera 'outside'"):
        make_many(2, models=[spec, spec], render_mode="rgb_array")


def test_each_environment_renders_its_own_model(nominal: mujoco.MjSpec) -> None:
    models = [nominal.copy(), nominal.copy()]
    for spec, x in zip(models, (0.0, 0.3), strict=True):
        body = spec.body(spec.joints[0].parent.name)
        body.add_geom(size=[0.1 + x] * 3, rgba=[1, x, 0, 1])
    envs = make_many(2, models=models, render_mode="rgb_array", width=64, height=48)
    envs.reset(seed=0)
    images = envs.render()
    assert images is not None
    for i, model in enumerate(models):
        env = make(model=model, render_mode="rgb_array", width=64, height=48)
        env.reset(seed=i)
        np.testing.assert_array_equal(images[i], env.render())
    assert np.any(images[0] != images[1])


def with_slides(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    for joint in spec.joints:
        joint.type = mujoco.mjtJoint.mjJNT_SLIDE
    return spec


def with_actuators(**values: Any) -> Callable[[mujoco.MjSpec], mujoco.MjSpec]:
    def change(spec: mujoco.MjSpec) -> mujoco.MjSpec:
        for name, value in values.items():
            setattr(spec.actuators[0], name, value)
        return spec

    return change


def with_option(**values: Any) -> Callable[[mujoco.MjSpec], mujoco.MjSpec]:
    def change(spec: mujoco.MjSpec) -> mujoco.MjSpec:
        for name, value in values.items():
            setattr(spec.option, name, value)
        return spec

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without_muscle, r"models\[1\] has no actuator"),
        (with_velocity_gain, "must pull its tendon by muscle stiffness control"),
        (with_free_forces, "has no forcerange"),
        (with_actuators(gear=[-1.0, 0, 0, 0, 0, 0]), "must have the gear 1, it has -1"),
        (with_actuators(gear=[2.0, 0, 0, 0, 0, 0]), "must have the gear 1, it has 2"),
        (with_actuators(ctrlrange=[0.0, 0.01], ctrllimited=True), "must have no ctrlrange"),
        (with_actuators(forcerange=[-10.0, 400.0]), "from -10 to 400 N"),
        (with_actuators(biasprm=[np.nan, -1.0] + [0.0] * 8), "must be finite"),
        (with_slides, "must be a hinge, as in the scene"),
        (with_option(timestep=0.1), r"timestep of models\[1\] is 0.1 s"),
        (with_option(timestep=0.0), "timestep"),
        (with_option(disableflags=int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)), "is disabled"),
        (lambda _: mujoco.MjSpec(), r"models\[1\] has no tendon"),
        (lambda _: 3, r"models\[1\] must be a mujoco.MjSpec"),
    ],
)
def test_a_model_that_does_not_fit_is_refused(
    nominal: mujoco.MjSpec, change: Any, message: str
) -> None:
    with pytest.raises(ArgumentError, match=message):
        make_many(2, models=[nominal, change(nominal.copy())])


def test_effects_beside_a_model_are_named_as_left_out(nominal: mujoco.MjSpec) -> None:
    """Such as a delay, which an extended model of `reality_gap` has beside its MJCF."""
    effect = SimpleNamespace(
        cause=SimpleNamespace(id="delay"),
        location=SimpleNamespace(elements=("biceps", "brachialis")),
    )
    sample = SimpleNamespace(spec=nominal, effects=(effect,))
    with pytest.warns(UserWarning, match="not simulated: delay of biceps, brachialis"):
        make(model=sample)


def test_a_model_of_another_scene_is_refused() -> None:
    posture = study_model(asset_path("mjcf/kengoro_arm/posture.xml"))

    with pytest.raises(KengoroError, match="must have the joints of the scene"):
        make(model=posture)


def test_a_file_is_a_model(nominal: mujoco.MjSpec, tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    path.write_text(nominal.to_xml(), encoding="utf-8")

    assert make(model=path).muscles == make().muscles


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"models": []}, "one model for each of 2 environments, it has 0"),
        ({"models": "nominal"}, "must be a list of 2 models"),
    ],
)
def test_a_wrong_number_of_models_is_refused(options: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        make_many(2, **options)


def test_a_model_excludes_other_robots(nominal: mujoco.MjSpec) -> None:
    with pytest.raises(ArgumentError, match="not both"):
        make_many(1, models=[nominal], robot_seed=1)
    with pytest.raises(ArgumentError, match="not both"):
        make(model=nominal, departures=())
    with pytest.raises(ArgumentError, match="own gains"):
        make(model=nominal, gains=kengoro_env.Gains(stiffness=1e4))
