"""Each watcher on made-up senses: it finds its fault, names nothing else, and lets go of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jmm_agent import faults
from jmm_agent.camera import Camera
from jmm_agent.errors import AgentError
from jmm_agent.faults import MotorControl
from jmm_agent.marker import MarkerPose, Skip
from jmm_agent.motion_watch import LateWatch, LateWatchOptions, PushWatch, PushWatchOptions
from jmm_agent.sight_watch import CameraWatch, MarkerWatch, SightWatchOptions
from jmm_agent.wire_watch import Felt, WireWatch, WireWatchOptions

DT = 0.02
MOTORS = MotorControl()
MUSCLES = ("one", "two", "three")


class Wires:
    """Three wires that move slowly and pull as their motors say, with noisy encoders."""

    def __init__(self) -> None:
        self.watch = WireWatch(MUSCLES, MOTORS, WireWatchOptions())
        self.rng, self.steps = np.random.default_rng(0), 0
        self.command = np.zeros(3)

    def live(
        self,
        steps: int,
        spoil: Callable[[np.ndarray, np.ndarray], None] = lambda lengths, tensions: None,
        expected: np.ndarray | None = None,
    ) -> Felt:
        """Some steps; ``spoil`` changes lengths [m] and tensions [N] of each in place."""
        for _ in range(steps):
            self.steps += 1
            true = self.command + 0.001
            lengths = true + 1e-4 * self.rng.standard_normal(3)
            tensions = MOTORS.demanded(lengths, self.command)
            spoil(lengths, tensions)
            told = true if expected is None else expected
            felt = self.watch.update(DT, lengths, tensions, self.command, told)
        return felt

    @property
    def found(self) -> list[tuple[str, str]]:
        return list(self.watch.found())


def jump(lengths: np.ndarray, tensions: np.ndarray) -> None:
    lengths[1] += 0.02


def stick(lengths: np.ndarray, tensions: np.ndarray) -> None:
    lengths[1] = 0.0012345


def die(lengths: np.ndarray, tensions: np.ndarray) -> None:
    lengths[1] = np.nan


def go_numb(lengths: np.ndarray, tensions: np.ndarray) -> None:
    tensions[1] = 0.0


def read_nothing(lengths: np.ndarray, tensions: np.ndarray) -> None:
    tensions[1] = np.nan


@pytest.mark.parametrize(
    ("spoil", "kind", "steps"),
    [
        (jump, faults.ENCODER_JUMP, 1),
        (stick, faults.ENCODER_STUCK, 25),
        (die, faults.ENCODER_DEAD, 1),
        (go_numb, faults.TENSION_SENSOR_DEAD, 30),
        (read_nothing, faults.TENSION_SENSOR_DEAD, 1),
    ],
)
def test_a_fault_of_a_wire_is_named_and_forgotten_when_it_has_gone(
    spoil: Callable[[np.ndarray, np.ndarray], None], kind: str, steps: int
) -> None:
    wires = Wires()
    wires.live(100)
    assert wires.found == []
    wires.live(steps, spoil)
    assert wires.found == [(kind, "two")]
    wires.live(200, spoil)
    assert wires.found == [(kind, "two")]
    wires.live(1)
    assert wires.found == []


def test_a_wire_without_tension_that_is_wound_up_has_snapped() -> None:
    wires = Wires()
    wires.live(100)
    wound = 0.0

    def snap(lengths: np.ndarray, tensions: np.ndarray) -> None:
        nonlocal wound
        wound += 0.2 * DT
        lengths[1] -= wound
        tensions[1] = 0.5

    felt = wires.live(15, snap)
    assert wires.found == [(faults.WIRE_SNAPPED, "two")]
    assert felt.unsafe.tolist() == felt.doubted.tolist() == [False, True, False]
    wires.live(100, snap)
    assert wires.found == [(faults.WIRE_SNAPPED, "two")]


def test_what_is_not_believed_is_marked_and_replaced() -> None:
    wires = Wires()
    wires.live(100)
    felt = wires.live(1, die)
    assert felt.doubted.tolist() == felt.unsafe.tolist() == [False, True, False]
    assert np.isfinite(felt.lengths).all()
    felt = wires.live(2, read_nothing)
    assert felt.numb.tolist() == [False, True, False]
    assert not felt.doubted.any()
    assert felt.tensions == pytest.approx(MOTORS.demanded(felt.lengths, wires.command))


def test_an_encoder_without_noise_does_not_stick_at_rest() -> None:
    wires = Wires()

    def quiet(lengths: np.ndarray, tensions: np.ndarray) -> None:
        lengths[:] = 0.001

    wires.live(500, quiet)
    assert wires.found == []


def test_a_fast_wire_has_not_jumped() -> None:
    wires = Wires()
    wires.live(10)
    for _ in range(20):
        wires.command = wires.command + 0.5 * DT
        wires.live(1)
        assert wires.found == []


@pytest.mark.parametrize("lengths", [(0.03,), (0.03, 0.002, 0.025)])
def test_a_wire_that_was_yanked_is_believed_again_as_the_others_tell_the_same(
    lengths: tuple[float, ...],
) -> None:
    wires = Wires()
    wires.live(100)
    for length in lengths:
        lagging = wires.command + 0.001
        wires.command = np.array([0.0, length, 0.0])
        wires.live(1, expected=lagging)  # what the other wires tell comes a step later
    assert wires.found == [(faults.ENCODER_JUMP, "two")]
    wires.live(60)
    assert wires.found == []


def test_an_encoder_that_jumped_is_not_believed_while_its_wire_moves() -> None:
    wires = Wires()
    wires.live(100)
    for _ in range(300):
        wires.command = wires.command + 0.2 * DT
        wires.live(1, jump)
        assert wires.found == [(faults.ENCODER_JUMP, "two")]


def late_watch(delay: int, steps: int, watch: LateWatch) -> bool:
    """Feed a watch with wires that obey commands some steps late."""
    time = DT * np.arange(steps + 20)
    commands = 0.03 * np.sin(2.0 * time[:, None] + np.arange(3))
    for k in range(20, steps + 20):
        lengths = commands[k - delay] + 0.002
        tensions = MOTORS.demanded(lengths, commands[k - delay])
        late = watch.update(lengths, tensions, commands[k], np.ones(3, dtype=bool))
    return late


def test_late_commands_are_noticed_until_they_come_in_time_again() -> None:
    watch = LateWatch(MOTORS, LateWatchOptions())
    assert not late_watch(0, 200, watch)
    assert late_watch(5, 80, watch)
    assert not late_watch(0, 80, watch)
    assert not late_watch(1, 80, watch)


def test_a_push_is_noticed_until_it_ends_and_a_steady_force_is_not() -> None:
    watch = PushWatch(PushWatchOptions())
    rng = np.random.default_rng(0)

    def feel(force: np.ndarray, times: int) -> bool:
        for _ in range(times):
            torques = -(force + rng.standard_normal(3))
            pushed = watch.update(0.1, torques, np.eye(3), np.eye(3))
        return pushed

    usual, more = np.array([8.0, 0.0, -5.0]), np.array([0.0, 40.0, 0.0])
    assert not feel(usual, 400)
    assert feel(usual + more, 5)
    assert feel(usual + more, 200)
    assert not feel(usual, 5)
    assert feel(usual + more, 5)
    assert not feel(usual + more, 400)  # a load, by now


def test_while_the_map_is_not_trusted_a_change_is_its_error_and_usual() -> None:
    watch = PushWatch(PushWatchOptions(usual_change=1.0))
    here = (np.eye(3), np.eye(3))

    def feel(force: float, trusted: bool) -> bool:
        pushes = [watch.update(0.1, np.array([-force, 0, 0]), *here, trusted) for _ in range(5)]
        return any(pushes)

    assert not any(feel(force, trusted=False) for force in 20 * [0.0, 60.0])
    assert not feel(0.0, trusted=True)
    assert not feel(60.0, trusted=True)  # by now it is known that forces seem to change so much
    assert feel(400.0, trusted=True)


def test_a_force_that_changes_slowly_is_no_push() -> None:
    watch = PushWatch(PushWatchOptions())
    for force in [0.0] * 400 + np.linspace(0.0, 120.0, 100).tolist():
        assert not watch.update(0.1, -np.array([force, 0.0, 0.0]), np.eye(3), np.eye(3))


def test_a_push_is_told_from_a_wrong_map_s_force_that_sways_with_the_arm() -> None:
    watch = PushWatch(PushWatchOptions())

    def feel(times: np.ndarray, push: float) -> list[bool]:
        forces = 30.0 * np.sin(2.0 * np.pi * times / 4.0)[:, None] * [1.0, 0.0, 0.0]
        forces[:, 1] += push
        return [watch.update(0.04, -force, np.eye(3), np.eye(3)) for force in forces]

    assert not any(feel(np.arange(0.0, 60.0, 0.04), 0.0))
    assert np.argmax(feel(np.arange(60.0, 64.0, 0.04), 40.0)) < 10
    assert feel(np.arange(60.0, 64.0, 0.04), 40.0)[-1]
    assert not feel(np.arange(64.0, 65.0, 0.04), 0.0)[-1]


def test_a_camera_freezes_when_no_frame_comes_or_the_hand_moves_in_the_same_picture() -> None:
    watch = CameraWatch(SightWatchOptions())
    frame, lengths = np.zeros((4, 4, 3), dtype=np.uint8), np.zeros(3)
    assert not watch.is_new(0.0, -np.inf)
    assert not watch.frozen  # an agent without a camera misses nothing
    assert watch.is_new(0.1, 0.0)
    assert watch.is_another(frame, lengths, True)
    assert not watch.is_new(1.0, 0.0)
    assert not watch.frozen
    watch.is_new(1.2, 0.0)
    assert watch.frozen
    assert watch.is_new(1.3, 1.2)
    assert not watch.frozen
    assert not watch.is_another(frame, lengths + 0.001, True)
    assert not watch.frozen
    watch.is_another(frame, lengths + 0.01, False)
    assert not watch.frozen
    watch.is_another(frame, lengths + 0.01, True)
    assert watch.frozen
    assert watch.is_another(frame + 1, lengths + 0.01, True)
    assert not watch.frozen


def test_a_camera_that_turns_without_another_picture_is_frozen() -> None:
    watch = CameraWatch(SightWatchOptions())
    frame, lengths = np.zeros((4, 4, 3), dtype=np.uint8), np.zeros(3)

    def look(degrees: float) -> bool:
        turned = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
        watch.is_another(frame, lengths, False, turned)
        return watch.frozen

    assert [look(angle) for angle in (0.0, 5.0, 7.0)] == [False, False, True]
    frame = frame + np.uint8(1)
    assert not look(7.0)
    watch.forget_estimate()
    assert [look(angle) for angle in (20.0, 25.0, 27.0)] == [False, False, True]


def facing(angle: float, x: float = 0.0) -> np.ndarray:
    """A marker's pose in the camera, half a metre away, turned from the line of sight [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.diag([1.0, -1.0, -1.0])
    pose[:3, 3] = [x, 0.0, 0.5]
    return pose


def seen(angle: float, x: float = 0.0) -> MarkerPose:
    return MarkerPose(0, facing(angle, x), np.zeros((4, 2)), 0.01, facing(-angle, x), 1.0)


@pytest.fixture
def marker() -> MarkerWatch:
    watch = MarkerWatch(Camera(640, 480, 580.0), SightWatchOptions())
    watch.update(0.0, seen(0.4), facing(1.0))  # the wires are wrong by 0.6 rad
    assert list(watch.found()) == []
    return watch


def test_a_marker_that_must_be_in_view_is_missed(marker: MarkerWatch) -> None:
    marker.update(0.2, Skip.NOT_SEEN, facing(1.0))
    assert list(marker.found()) == []
    marker.update(0.4, Skip.UNCLEAR, facing(1.0))
    assert list(marker.found()) == [faults.MARKER_HIDDEN]
    for k in range(3, 14):
        marker.update(0.2 * k, seen(0.4), facing(1.0))
    assert list(marker.found()) == []


def test_a_marker_that_is_hidden_right_after_the_map_changed_is_missed(marker: MarkerWatch) -> None:
    marker.forget_estimate()
    for k in (1, 2):
        marker.update(0.2 * k, Skip.NOT_SEEN, facing(1.7))  # what the new map has it look like
    assert list(marker.found()) == [faults.MARKER_HIDDEN]


def test_a_marker_that_left_the_view_before_the_map_changed_is_not_missed(
    marker: MarkerWatch,
) -> None:
    marker.update(0.2, Skip.NOT_SEEN, facing(1.0, x=0.45))
    marker.forget_estimate()
    for k in range(2, 6):
        marker.update(0.2 * k, Skip.NOT_SEEN, facing(1.2, x=0.45))
    assert list(marker.found()) == []


@pytest.mark.parametrize("believed", [facing(1.0, x=0.45), facing(1.7)])
def test_a_marker_that_leaves_the_view_is_not_missed(
    marker: MarkerWatch, believed: np.ndarray
) -> None:
    for k in range(1, 5):
        marker.update(0.2 * k, Skip.NOT_SEEN, believed)
    assert list(marker.found()) == []


def test_a_second_marker_is_named_even_before_the_wires_are_believed() -> None:
    watch = MarkerWatch(Camera(640, 480, 580.0), SightWatchOptions())
    watch.update(0.0, Skip.TWICE, None)
    assert list(watch.found()) == [faults.SECOND_MARKER]
    watch.update(0.2, seen(0.4), None)
    assert list(watch.found()) == []


def test_a_mirrored_marker_is_named_for_as_long_as_it_is(marker: MarkerWatch) -> None:
    for k in range(1, 10):
        marker.update(0.2 * k, seen(-0.4), facing(1.0))
        assert list(marker.found()) == [faults.MIRRORED_MARKER]
    marker.update(2.0, seen(-0.05), facing(0.62))  # as good as head-on: who can tell?
    assert list(marker.found()) == [faults.MIRRORED_MARKER]
    marker.update(2.2, seen(0.4), facing(1.0))
    assert list(marker.found()) == []


def test_a_marker_that_stays_mirrored_is_right_after_all(marker: MarkerWatch) -> None:
    found = []
    for k in range(1, 100):
        marker.update(0.2 * k, seen(-0.4), facing(1.0))
        found.append(list(marker.found()))
    frames = SightWatchOptions().longest / 0.2
    assert found.count([faults.MIRRORED_MARKER]) == pytest.approx(frames, abs=1)
    assert found[-1] == []


def test_a_marker_that_turns_with_the_wires_is_not_mirrored(marker: MarkerWatch) -> None:
    marker.update(0.2, seen(-0.4), facing(0.2))
    assert list(marker.found()) == []


@pytest.mark.parametrize(
    ("name", "value"), [("stiffness", 0.0), ("bias", np.nan), ("limit", np.inf), ("limit", 20.0)]
)
def test_motors_that_cannot_be_are_refused(name: str, value: float) -> None:
    with pytest.raises(AgentError, match=name):
        MotorControl(**{name: value})
