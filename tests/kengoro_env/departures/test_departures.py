"""Departures: null is the nominal model, small is close to it, and none breaks physics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest

from kengoro_env import departures
from kengoro_env.assets import asset_path
from kengoro_env.departures import (
    AttachmentDisplacement,
    BoneError,
    BoneWrapping,
    CameraError,
    DryFriction,
    Elongation,
    EncoderError,
    FrameDelay,
    FrameTimeError,
    HeatingMotors,
    LensDistortion,
    MarkerError,
    MotorInertia,
    NoCanMarker,
    NoHandMarker,
    Payload,
    TendonStretch,
    TensionSensorError,
    ZeroPosture,
    actual,
    drawing,
)
from kengoro_env.errors import KengoroError, UnknownNameError
from kengoro_env.postures import posture_set
from kengoro_env.robot import robot
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

ARM = asset_path("mjcf/kengoro_arm/posture.xml")
NOMINAL = NominalArm(ARM)
START, GOAL = posture_set()[[0, 5]]
RAMP, STEPS = 25, 60


@dataclass(frozen=True)
class Case:
    """A departure by one parameter, and the values at which it is large and almost null."""

    build: Callable[[float], Departure]
    large: float
    small: float
    # A tendon this stiff is unstable under the arm's own integrator at 2 ms, see below.
    integrator: mujoco.mjtIntegrator | None = None


CASES = {
    "AttachmentDisplacement": Case(lambda p: AttachmentDisplacement(sigma=p, seed=1), 4e-3, 2e-6),
    "BoneError": Case(lambda p: BoneError(position=p, rotation=10 * p, seed=1), 5e-3, 2e-6),
    "BoneWrapping": Case(lambda p: BoneWrapping(scale=p), 1.0, 1e-3),
    "CameraError": Case(lambda p: CameraError(focal=p, position=p, rotation=p, seed=1), 1e-2, 1e-7),
    "DryFriction": Case(lambda p: DryFriction(constant=10 * p, ratio=p), 0.1, 1e-5),
    "Elongation": Case(lambda p: Elongation("biceps", p), 1e-2, 1e-6),
    "EncoderError": Case(lambda p: EncoderError(offset=p, noise=p, quantum=p, seed=1), 1e-3, 1e-6),
    "FrameDelay": Case(lambda p: FrameDelay(delay=p), 0.1, 1e-6),
    "FrameTimeError": Case(
        lambda p: FrameTimeError(offset=p, jitter=p, drift=p, seed=1), 0.05, 1e-6
    ),
    "HeatingMotors": Case(lambda p: HeatingMotors(heat=p, seed=1), 4e-4, 1e-9),
    "LensDistortion": Case(lambda p: LensDistortion(k1=p, p1=p / 10), -0.2, -1e-6),
    "MarkerError": Case(lambda p: MarkerError(size=p, position=p, rotation=p, seed=1), 1e-2, 1e-7),
    "MotorInertia": Case(lambda p: MotorInertia(inertia=p), 3.0, 1e-3),
    "NoCanMarker": Case(lambda p: NoCanMarker(removed=p > 0.0), 1.0, 0.0),
    "NoHandMarker": Case(lambda p: NoHandMarker(removed=p > 0.0), 1.0, 0.0),
    "Payload": Case(lambda p: Payload(mass=p), 1.0, 1e-4),
    "TensionSensorError": Case(lambda p: TensionSensorError(noise=p, offset=p, seed=1), 3.0, 1e-3),
    "TendonStretch": Case(
        lambda p: TendonStretch(compliance=p, hardening=4e6),
        1e-5,
        1e-7,
        mujoco.mjtIntegrator.mjINT_DISCRETE,
    ),
    "ZeroPosture": Case(
        lambda p: ZeroPosture(shoulder=p, scapula=p, forearm=p, neck=p, seed=1), 0.3, 1e-5
    ),
}
NOT_IN_PRESET = {
    "BoneError",
    "Elongation",
    "FrameTimeError",
    "HeatingMotors",
    "LensDistortion",
    "MarkerError",
    "NoCanMarker",
    "NoHandMarker",
    "Payload",
}
"""Departures that `actual(seed)` has not."""
UNMOVED = ("HeatingMotors", "NoCanMarker", "NoHandMarker")
MOVING = [name for name in CASES if name not in UNMOVED]
"""Departures that change the motion or what is measured; heat and looks do not."""


def test_every_departure_has_a_case() -> None:
    assert set(CASES) == {name for name in departures.__all__ if name[0].isupper()}


def compiled(chosen: tuple[Departure, ...]) -> bytes:
    """All numbers and names of the compiled model of a robot."""
    model = Robot(ARM, chosen).model
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


@pytest.mark.parametrize("name", CASES)
def test_null_leaves_the_compiled_model_identical(name: str) -> None:
    null = getattr(departures, name)()
    assert compiled((null,)) == compiled(drawing())
    assert CASES[name].build(0.0).edit is not None
    assert compiled((CASES[name].build(0.0),)) == compiled(drawing())


def movement(*chosen: Departure) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Joint angles [rad], lengths [m], tensions [N] of a short movement, and the view."""
    arm = Robot(ARM, chosen)
    arm.reset(START, np.random.default_rng(0))
    start, goal = NOMINAL.lengths(np.array([START, GOAL]))
    rows = []
    for step in range(1, STEPS + 1):
        arm.step(start + min(1.0, step / RAMP) * (goal - start))
        rows.append((arm.joint_angles, arm.measured_lengths(), arm.measured_tensions()))
    joints, lengths, tensions = (np.array(column) for column in zip(*rows, strict=True))
    eye, plate = arm.model.camera("eye"), arm.model.body("marker_plate")
    times = arm.frame_times
    timing = [arm.frame_delay, times.offset, times.jitter, times.drift]
    marker = [*plate.pos, *plate.quat, *arm.model.geom("marker_plate").size]
    lens = np.zeros(5) if arm.lens is None else arm.lens
    camera = np.concatenate([eye.pos, eye.quat, eye.fovy, timing, marker, lens])
    return joints, lengths, tensions, camera


@pytest.mark.parametrize("name", MOVING)
def test_towards_null_the_robot_becomes_the_nominal_model(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    case, load = CASES[name], robot.load_spec

    def load_with_integrator(path: Path, folders: Sequence[Path | str]) -> mujoco.MjSpec:
        spec = load(path, folders)
        if case.integrator is not None:
            spec.option.integrator = case.integrator
        return spec

    monkeypatch.setattr(robot, "load_spec", load_with_integrator)
    null = movement()
    # Largest over the whole movement.
    large, small = (
        [
            np.degrees(np.abs(there[0] - null[0]).max()),
            1e3 * np.abs(there[1] - null[1]).max(),
            np.abs(there[2] - null[2]).max(),
            np.abs(there[3] - null[3]).max(),
        ]
        for there in (movement(case.build(case.large)), movement(case.build(case.small)))
    )
    assert small[0] < 0.05
    assert small[1] < 0.1
    assert small[2] < 5.0  # 1 % of what a motor pulls
    assert small[3] < 1e-4
    # It does something when it is large.
    assert large[0] > 0.3 or large[1] > 0.3 or large[2] > 1.0 or large[3] > 1e-3


def trembling(arm: Robot, seed: int) -> float:
    """Oscillation of the joint speeds after moves between postures of the set [rad/s]."""
    rng = np.random.default_rng(seed)
    postures = posture_set()[rng.integers(len(posture_set()), size=4)]
    arm.reset(postures[0], rng)
    largest = 0.0
    for target in NOMINAL.lengths(postures):
        start, speeds = arm.target, []
        for step in range(1, 101):
            arm.step(start + min(1.0, step / 50) * (target - start))
            speeds.append([arm.data.joint(joint).qvel[0] for joint in arm.joints])
        jumps = np.abs(np.diff(speeds[-25:], 2, axis=0)).max(axis=1)
        largest = max(largest, float(np.median(jumps)))  # a knock at a stop is no trembling
        assert arm.tensions.max() < 600.0
    return largest


def test_the_preset_is_far_from_the_stiffness_at_which_tendons_become_unstable() -> None:
    """Under the arm's own integrator, tendons of half the preset's compliance do not oscillate.

    Stiffer ones do, from 2e-6 m/N on: their convergence is shown with another integrator.
    """
    (stretch,) = (d for d in actual(0) if isinstance(d, TendonStretch))
    stiffer = TendonStretch(stretch.compliance / 2.0, stretch.hardening)
    chosen = tuple(stiffer if d is stretch else d for d in actual(0))
    assert trembling(Robot(ARM, chosen), seed=0) < 0.1


@pytest.mark.parametrize("seed", [0, 1])
def test_tension_is_never_negative_in_random_motion(seed: int) -> None:
    arm, rng = Robot(ARM, actual(seed)), np.random.default_rng(seed)
    arm.reset(START, rng)
    for _ in range(60):
        arm.step(NOMINAL.lengths(posture_set()[rng.integers(1000)])[0] + rng.normal(0, 0.01, 36))
        assert np.all(arm.tensions >= 0.0)
        assert np.all(arm.measured_tensions() >= 0.0)
        assert np.all(arm.motors.paths() > 0.0)


@pytest.mark.parametrize("seed", range(0, 96, 8))
def test_actual_robots_are_stable_over_the_posture_set(seed: int) -> None:
    assert trembling(Robot(ARM, actual(seed)), seed) < 0.1


@pytest.mark.parametrize("chosen", [(), (TendonStretch(1e-5),)], ids=["ideal", "stretch"])
def test_an_elongation_during_the_motion_shifts_only_its_own_reading(
    chosen: tuple[Departure, ...],
) -> None:
    scene = asset_path("mjcf/kengoro_arm/elbow.xml")
    given = Robot(scene, (*chosen, Elongation("biceps", 0.004, time=0.5)))
    whole = Robot(scene, chosen)
    called = Robot(scene, chosen)
    before = {}
    for arm in (given, whole, called):
        arm.reset(np.array([1.0]), np.random.default_rng(0))
        target = arm.target.copy()
        for step in range(120):
            if step == 25:
                before[arm] = arm.lengths
                if arm is called:
                    arm.elongate("biceps", 0.004)
            arm.step(target)
    # Nothing differs before, the two ways of giving are one, and only the biceps has given.
    assert np.array_equal(before[given], before[whole])
    assert np.array_equal(given.lengths, called.lengths)
    path = NominalArm(scene)
    shift = [arm.lengths - path.lengths(arm.joint_angles)[0] for arm in (given, whole)]
    assert np.allclose(shift[0] - shift[1], [-0.004, 0.0, 0.0], atol=5e-4)
    # A flexor that gave holds the forearm lower.
    assert given.joint_angles[0] < whole.joint_angles[0] - np.radians(0.5)
    given.reset(np.array([1.0]), np.random.default_rng(0))
    assert np.array_equal(given.motors.elongation, np.zeros(3))


def test_friction_follows_the_tension() -> None:
    """Friction is constant + ratio * tension, tendon by tendon."""
    scene = asset_path("mjcf/kengoro_arm/elbow.xml")
    arm = Robot(scene, (DryFriction(constant=2.0, ratio=0.1),))
    arm.reset(np.array([1.0]), np.random.default_rng(0))
    for _ in range(50):
        arm.step(arm.target)
    loss = arm.model.tendon_frictionloss[[arm.model.tendon(m).id for m in arm.muscles]]
    assert np.allclose(loss, 2.0 + 0.1 * arm.tensions, rtol=0.02)


def test_inertia_over_a_bone_needs_a_tendon_that_stretches() -> None:
    with pytest.raises(KengoroError, match=r"tendon of .* wraps over a bone.*add TendonStretch"):
        Robot(ARM, (BoneWrapping(1.0), MotorInertia(1.0)))


@pytest.mark.parametrize("elongation", [Elongation("bisceps", 0.01), Elongation("", 0.01, 1.0)])
def test_an_unknown_muscle_is_named(elongation: Elongation) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown muscle '.*'; known: scm_left, "):
        Robot(ARM, (elongation,))


def test_the_preset_holds_every_departure_but_those_left_out() -> None:
    kinds = {type(departure).__name__ for departure in actual(5)}
    assert kinds == set(CASES) - NOT_IN_PRESET
    assert actual(5) == actual(5)
    assert actual(5) != actual(6)


def test_a_payload_weighs_where_it_is() -> None:
    q = START
    with_ball = Robot(ARM, (Payload(0.7),))
    weights = {}
    for chosen in ((), (Payload(0.7),)):
        model = Robot(ARM, chosen).model
        weights[bool(chosen)] = model.body_mass.sum()
    assert weights[True] - weights[False] == pytest.approx(0.7)
    with_ball.reset(q, np.random.default_rng(0))
    grip = with_ball.data.site("grip").xpos
    ball = with_ball.data.xpos[np.isclose(with_ball.model.body_mass, 0.7)]
    assert np.linalg.norm(ball - grip, axis=1).min() < 1e-9


@pytest.mark.parametrize("mass", [-0.1, np.nan, np.inf])
def test_a_payload_needs_a_mass(mass: float) -> None:
    with pytest.raises(KengoroError, match=r"mass is .* kg, but must be finite"):
        Payload(mass)


def test_a_payload_needs_a_site_of_the_robot() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown site 'palm'; known: .*grip"):
        Robot(ARM, (Payload(0.5, "palm"),))
