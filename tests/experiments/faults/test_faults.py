"""Faults are injected as specified, and their outcomes are counted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from experiments.faults.frames import HIDDEN_SHARE
from experiments.faults.injection import (
    JUMP,
    LATE_STEPS,
    PUSH,
    FaultyEnv,
    Injection,
)
from experiments.faults.run import QUICK, FaultyRun, conclude, run
from experiments.faults.tables import NO_FAULT, metrics, seed_entry, tables
from experiments.robots.conditions import ACTUAL
from jmm_agent.guard import faults
from jmm_agent.guard.guard import Guard
from jmm_agent.vision.marker_detector import MarkerDetector, Skip
from kengoro.agents import make_agent
from kengoro.robots import CAMERA, HAND, SIDES, make_env
from kengoro_env.postures import posture_set

MUSCLE, INDEX = "delt_mid", 19


@pytest.fixture
def env() -> Iterator[FaultyEnv]:
    """A robot without departures, with noiseless sensors and without a camera."""
    faulty = FaultyEnv(make_env("Posture", None, camera=False), MarkerDetector(CAMERA, SIDES))
    faulty.reset(seed=0, options={"posture": posture_set()[0]})
    assert faulty.world.muscles.index(MUSCLE) == INDEX
    yield faulty
    faulty.close()


def step(env: FaultyEnv, lengths: np.ndarray) -> tuple[dict[str, Any], dict[str, Any]]:
    """Command lengths (m,) [m]; observation, and truth."""
    observation, *_, info = env.step(env.world.lengths_to_action(lengths))
    return observation, info


def test_without_a_fault_nothing_is_changed(env: FaultyEnv) -> None:
    target = env.world.robot.target
    observation, _ = step(env, target)
    np.testing.assert_array_equal(observation["lengths"], env.world.robot.lengths)
    np.testing.assert_allclose(env.world.robot.target, target, atol=1e-6)


def test_a_motor_pulls_by_what_its_encoder_reads(env: FaultyEnv) -> None:
    target = env.world.robot.target
    env.inject(Injection(faults.ENCODER_JUMP, MUSCLE))
    before, _ = step(env, target)
    assert before["lengths"][INDEX] == pytest.approx(env.world.robot.lengths[INDEX] + JUMP)
    step(env, target)
    assert env.world.robot.target[INDEX] == pytest.approx(target[INDEX] - JUMP, abs=1e-6)
    others = np.arange(36) != INDEX
    np.testing.assert_allclose(env.world.robot.target[others], target[others], atol=1e-6)
    env.inject(None)
    observation, _ = step(env, target)
    np.testing.assert_array_equal(observation["lengths"], env.world.robot.lengths)


def test_a_stuck_encoder_and_a_dead_sensor_read_the_same_for_ever(env: FaultyEnv) -> None:
    target = env.world.robot.target
    expected, _ = step(env, target)
    env.inject(Injection(faults.ENCODER_STUCK, MUSCLE))
    for _ in range(3):
        target = target - 0.002
        observation, _ = step(env, target)
        assert observation["lengths"][INDEX] == expected["lengths"][INDEX]
        assert observation["lengths"][INDEX + 1] != expected["lengths"][INDEX + 1]
    env.inject(Injection(faults.TENSION_SENSOR_DEAD, MUSCLE))
    observation, _ = step(env, target)
    assert np.flatnonzero(observation["tensions"] == 0.0).tolist() == [INDEX]
    env.inject(Injection(faults.ENCODER_DEAD, MUSCLE))
    observation, _ = step(env, target)
    assert np.flatnonzero(np.isnan(observation["lengths"])).tolist() == [INDEX]


def test_late_commands_are_obeyed_later(env: FaultyEnv) -> None:
    first = env.world.robot.target
    env.inject(Injection(faults.COMMAND_LATE))
    commands = [first - 1e-4 * k for k in range(12)]
    for k, command in enumerate(commands):
        step(env, command)
        np.testing.assert_allclose(
            env.world.robot.target, commands[max(0, k - LATE_STEPS)], atol=1e-6
        )


def test_a_push_moves_the_hand_and_ends(env: FaultyEnv) -> None:
    target = env.world.robot.target
    _, info = step(env, target)
    env.inject(Injection(faults.PUSHED, direction=(0.0, 0.0, 1.0)))
    assert env.world.robot.data.xfrc_applied.sum() == pytest.approx(PUSH)
    for _ in range(20):
        _, pushed = step(env, target)
    assert pushed["hand_pose"][2, 3] - info["hand_pose"][2, 3] > 0.005
    env.inject(None)
    assert not env.world.robot.data.xfrc_applied.any()


def test_a_snapped_muscle_never_pulls_again(env: FaultyEnv) -> None:
    env.inject(Injection(faults.MUSCLE_SNAPPED, MUSCLE))
    env.inject(None)
    target = env.world.robot.target
    for _ in range(3):
        step(env, target)
    assert env.world.robot.motors.elongation[INDEX] > 1.0


def test_commands_are_judged_by_what_they_demand(env: FaultyEnv) -> None:
    target = env.world.robot.target
    target[INDEX] -= 0.005
    step(env, target)
    assert env.largest_demand == pytest.approx(30.0 + 30_000.0 * 0.005, rel=1e-3)


@pytest.fixture(scope="module")
def frame() -> np.ndarray:
    """View of the hand by the robot's camera."""
    env = make_env("Posture", None)
    observation, _ = env.reset(seed=0, options={"posture": posture_set()[0]})
    env.close()
    return np.array(observation["frame"])


def test_a_marker_is_hidden_for_a_share_of_the_time_doubled_and_mirrored(
    env: FaultyEnv, frame: np.ndarray
) -> None:
    detector, times = env.detector, 0.2 * np.arange(20)
    marker = detector.detect(frame).poses[0]

    def view(kind: str, time: float) -> np.ndarray:
        picture = frame.copy()
        env.inject(Injection(kind))
        env._disturbed({"lengths": np.zeros(36), "frame": picture, "frame_time": np.array([time])})
        return picture

    hidden = [0 not in detector.detect(view(faults.MARKER_HIDDEN, t)).poses for t in times]
    assert np.mean(hidden) == pytest.approx(HIDDEN_SHARE, abs=0.05)
    assert detector.detect(view(faults.SECOND_MARKER, 0.0)).skips[0] is Skip.TWICE
    env.inject(Injection(faults.MIRRORED_MARKER))
    pose = detector.detect(frame).poses[0].pose_marker_in_camera
    np.testing.assert_array_equal(pose, marker.pose_marker_in_camera, "a frame from before")
    mirrored = detector.detect(view(faults.MIRRORED_MARKER, 0.0)).poses[0]
    np.testing.assert_array_equal(mirrored.pose_marker_in_camera, marker.flipped_in_camera)
    env.inject(None)
    np.testing.assert_array_equal(
        detector.detect(frame).poses[0].pose_marker_in_camera, marker.pose_marker_in_camera
    )


@pytest.fixture(scope="module")
def seen() -> Iterator[tuple[FaultyEnv, np.ndarray, np.ndarray]]:
    """A robot whose hand carries no marker, a frame of it, and the pixels of its hand."""
    faulty = FaultyEnv(make_env("Posture", None, hand="seen"), None)
    observation, _ = faulty.reset(seed=0, options={"posture": posture_set()[5]})
    robot = faulty.world.robot
    with mujoco.Renderer(robot.model, 480, 640) as renderer:
        renderer.enable_segmentation_rendering()
        renderer.update_scene(robot.data, "eye")
        geoms, kinds = np.moveaxis(renderer.render(), 2, 0)
    parts = ("hand", "fingers_proximal", "fingers_distal", "thumb_proximal", "thumb_distal")
    bodies = [robot.model.body(part).id for part in parts]
    of_hand = np.isin(robot.model.geom_bodyid[geoms], bodies) & (geoms >= 0)
    pixels = of_hand & (kinds == mujoco.mjtObj.mjOBJ_GEOM)
    assert 1000 < pixels.sum() < 40_000
    yield faulty, observation["frame"], pixels
    faulty.close()


def shown_frames(env: FaultyEnv, kind: str, frame: np.ndarray, count: int) -> list[np.ndarray]:
    """Frames at 0, 0.2, 0.4 s, ... with a fault, of a robot at rest."""
    env.inject(Injection(kind))
    frames = [frame.copy() for _ in range(count)]
    for k, picture in enumerate(frames):
        time = np.array([0.2 * k])
        env._disturbed({"lengths": np.zeros(36), "frame": picture, "frame_time": time})
    return frames


def test_a_hand_without_a_marker_is_hidden_for_a_share_of_the_time_and_its_copy_is_elsewhere(
    seen: tuple[FaultyEnv, np.ndarray, np.ndarray],
) -> None:
    env, frame, hand = seen
    changed = [
        np.any(picture != frame, axis=2)
        for picture in shown_frames(env, faults.HAND_HIDDEN, frame, 20)
    ]
    shares = np.array([one[hand].mean() for one in changed])
    assert np.mean(shares > 0.9) == pytest.approx(HIDDEN_SHARE, abs=0.05)
    assert np.all((shares > 0.9) | (shares == 0.0))
    sides = [int(np.ptp(at)) for at in np.nonzero(hand)]
    assert max(one.sum() for one in changed) < 1.8 * sides[0] * sides[1], "little but the hand"
    assert Injection(faults.HAND_HIDDEN).where == "hand"
    [copied] = shown_frames(env, faults.SECOND_HAND, frame, 1)
    new = np.any(copied != frame, axis=2)
    assert new.sum() > 0.5 * hand.sum()
    assert new[hand].mean() < 0.1, "the own one is still seen"
    [mirrored] = shown_frames(env, faults.MIRRORED_HAND, frame, 1)
    np.testing.assert_array_equal(mirrored, frame[:, ::-1])


def test_a_hand_is_hidden_where_it_was_when_the_frame_was_taken(
    seen: tuple[FaultyEnv, np.ndarray, np.ndarray],
) -> None:
    """Frames come 0.1 s late, and the hand has moved on since."""
    env, frame, hand = seen
    data = env.world.robot.data
    env.inject(Injection(faults.HAND_HIDDEN))
    taken, picture = data.time, frame.copy()
    for step in range(2):
        late = frame.copy() if step == 0 else picture
        time = np.array([taken - 0.2 if step == 0 else taken])  # the first frame is an older one
        env._disturbed({"lengths": np.zeros(36), "frame": late, "frame_time": time})
        data.geom_xpos[:] += 0.3
        data.time += 0.1
    mujoco.mj_forward(env.world.robot.model, data)
    data.time = taken
    assert np.any(picture != frame, axis=2)[hand].mean() > 0.9


def test_a_run_without_a_marker_has_an_agent_that_sees_the_hand(
    request: pytest.FixtureRequest,
) -> None:
    maps = Path(request.config.cache.mkdir("maps"))
    kinds = []
    for hand in ("marker", "seen"):
        robot = FaultyRun(0, maps, replace(QUICK, hand=hand))
        kinds.append(robot.agent.options.vision.hand)
        assert (robot.env.detector is None) == (hand == "seen")
        frame = robot.env.world.reset(seed=0, options={"posture": posture_set()[0]})[0]["frame"]
        assert (HAND in MarkerDetector(CAMERA, SIDES).detect(frame).poses) == (hand == "marker")
        robot.copy().env.close()
        robot.env.close()
    assert kinds == ["marker", "seen"]


def test_a_picture_of_the_hand_stays_where_the_hand_was_while_it_moves(
    seen: tuple[FaultyEnv, np.ndarray, np.ndarray],
) -> None:
    env, frame, hand = seen
    model, data = env.world.robot.model, env.world.robot.data
    env.inject(Injection(faults.OTHER_HAND))
    later = np.roll(frame, 60, axis=1)
    for k, picture in enumerate((frame.copy(), later)):
        if k:
            eye = data.camera("eye")
            focal, depth = (
                240.0 / np.tan(np.radians(22.5)),
                -float((data.body("hand").xpos - eye.xpos) @ eye.xmat.reshape(3, 3)[:, 2]),
            )
            data.geom_xpos[:] += 60.0 / focal * depth * eye.xmat.reshape(3, 3)[:, 0]
        time = np.array([0.2 * k])
        now = {"lengths": np.zeros(36), "frame": picture, "frame_time": time}
        env.world.robot.data.time += 0.2 * k
        env._disturbed(now)
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(later[hand], frame[hand])
    moved = np.roll(hand, 60, axis=1) & ~hand
    assert np.mean(np.any(later != np.roll(frame, 60, axis=1), axis=2)[moved]) > 0.9


def make_record(named: list[Any], **more: Any) -> dict[str, Any]:
    return {
        "named": named,
        "largest_demand_N": 400.0,
        "largest_tension_N": 410.0,
        "not_finite": 0,
        "taken_back": 0,
        **more,
    }


def trial(
    kind: str,
    where: str,
    named: list[Any],
    after_mm: float = 3.0,
    shown: float | None = 100.0,
) -> dict[str, Any]:
    return make_record(
        named, kind=kind, where=where, begin=100.0, shown=shown, gone=110.0, before_mm=4.0,
        after_mm=after_mm, still_named=[],
    )  # fmt: skip


def test_namings_are_counted_as_right_wrong_or_late() -> None:
    pushed = [faults.PUSHED, "hand", [101.5]]
    late = [faults.COMMAND_LATE, "commands", [105.0, 120.0]]
    entry = seed_entry(
        {
            "learning": make_record([late]),
            "trials": {
                NO_FAULT: trial(NO_FAULT, "", [late], shown=None),
                faults.PUSHED: trial(faults.PUSHED, "hand", [pushed, late], after_mm=6.0),
                faults.COMMAND_LATE: trial(faults.COMMAND_LATE, "commands", [late]),
            },
        }
    )
    assert entry["learning"]["false_namings"] == ["command_late commands"]
    assert entry[NO_FAULT]["false_namings"] == ["command_late commands"] * 2
    assert entry[faults.PUSHED]["noticed_after_s"] == 1.5
    assert entry[faults.PUSHED]["also_named"] == ["command_late commands"]
    assert entry[faults.PUSHED]["false_namings"] == ["command_late commands"]
    assert entry[faults.PUSHED]["ratio"] == 1.5
    assert entry[faults.COMMAND_LATE]["noticed_after_s"] == 5.0
    table = tables({0: entry})[0]
    row = {row[0]: row for row in table.rows}
    assert row[faults.PUSHED][1] == "1 of 1"
    assert row[faults.COMMAND_LATE][1] == "0 of 1"
    assert row[faults.PUSHED][5] == 1


def test_any_name_of_a_hand_without_a_marker_is_a_right_one() -> None:
    entry = {}
    for kind, where in ((faults.HAND_HIDDEN, "hand"), (faults.MARKER_HIDDEN, "marker")):
        named = [[kind, where, [100.5]]]
        found = seed_entry(
            {
                "learning": make_record([]),
                "trials": {faults.MIRRORED_HAND: trial(faults.MIRRORED_HAND, "hand", named)},
            }
        )
        entry[kind] = found[faults.MIRRORED_HAND]
    assert entry[faults.HAND_HIDDEN]["noticed_after_s"] == 0.5
    assert entry[faults.HAND_HIDDEN]["also_named"] == ["hand_hidden hand"]
    assert entry[faults.MARKER_HIDDEN]["noticed_after_s"] is None


def test_seconds_count_from_when_a_fault_shows() -> None:
    named, entries = [faults.SECOND_MARKER, "marker", [104.5]], {}
    for seed, shown in enumerate((100.0, 104.0, None)):
        part = trial(faults.SECOND_MARKER, "marker", [named], shown=shown)
        entries[seed] = seed_entry(
            {"learning": make_record([]), "trials": {faults.SECOND_MARKER: part}}
        )
    named_after = [entry[faults.SECOND_MARKER]["noticed_after_s"] for entry in entries.values()]
    assert named_after == [4.5, 0.5, None]
    never = entries[2][faults.SECOND_MARKER]
    assert never["also_named"] == ["second_marker marker"]
    assert tables(entries)[0].rows[0][1] == "1 of 2"
    assert metrics(entries)["noticed_in_time"]["median"] == 50.0


def test_a_marker_that_is_not_in_view_is_not_hidden_yet(env: FaultyEnv, frame: np.ndarray) -> None:
    env.inject(Injection(faults.PUSHED))
    assert env.shown == env.world.robot.time
    for kind in (faults.MARKER_HIDDEN, faults.SECOND_MARKER, faults.MIRRORED_MARKER):
        env.inject(Injection(kind))
        for picture, shown in ((np.zeros_like(frame), None), (frame, env.world.robot.time)):
            now = {"lengths": np.zeros(36), "frame": picture.copy(), "frame_time": np.zeros(1)}
            env._disturbed(now)
            assert env.shown == shown


def test_the_agent_watches_and_undoes_what_harms(request: pytest.FixtureRequest) -> None:
    agent = make_agent(0, guard=True, cache=Path(request.config.cache.mkdir("maps")))
    assert isinstance(agent.guard, Guard)
    assert agent.vision.hold_out is not None


def test_a_copied_run_goes_on_as_the_run_itself_does(request: pytest.FixtureRequest) -> None:
    first = FaultyRun(0, Path(request.config.cache.mkdir("maps")), QUICK)
    first.advance(0.2)
    second = first.copy()
    for one in (first, second):
        one.advance(0.2)
    np.testing.assert_array_equal(first.agent.joint_angles, second.agent.joint_angles)
    assert first.session.time == second.session.time


@pytest.mark.slow
def test_a_short_run_names_what_it_injects(request: pytest.FixtureRequest) -> None:
    kinds = (NO_FAULT, faults.ENCODER_JUMP, faults.SECOND_MARKER)
    sizes = replace(QUICK, trials=kinds)
    result = run(ACTUAL, 0, sizes, Path(request.config.cache.mkdir("maps")))
    found = conclude({0: {ACTUAL: result}}, sizes)
    assert found.metrics["noticed_in_time"]["median"] == 100.0
    assert found.metrics["not_finite"]["median"] == 0.0
    assert found.metrics["largest_demand"]["median"] < 500.1
    assert found.per_seed[0][NO_FAULT]["false_namings"] == []
