"""The own hand among others by its movement, with an expected pose 100 mm and 10 deg off."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.hand_detection import HandDetection, HandsDetector, HandSkip
from jmm_agent.vision.hand_finder import HandMissed, HandSeen
from jmm_agent.vision.hand_shape import HandShape
from jmm_agent.vision.own_hand import ExpectedPoses, OwnHand, Sample, difference, explain
from tests.jmm_agent.nominal_arm import posture_set

SEEDS = range(12)
MOVEMENTS = 6
HEAD = slice(0, 3)
"""Joints of the neck, which turn the camera."""
DEVIATION = np.array([0.003, 0.003, 0.01, 0.03, 0.03, 0.03])
"""Of a detected pose [m, rad]."""


def displaced(pose: Floats, change: Floats) -> Floats:
    """A pose, moved by an offset and turned by a rotation vector (6,) [m, rad]."""
    result = pose.copy()
    result[:3, 3] += change[:3]
    result[:3, :3] = Rotation.from_rotvec(change[3:]).as_matrix() @ pose[:3, :3]
    return result


def direction(rng: np.random.Generator) -> Floats:
    found = rng.standard_normal(3)
    return found / np.linalg.norm(found)


def postures(rng: np.random.Generator, head_turns: bool = True) -> Floats:
    """Postures (MOVEMENTS + 1, 14) [rad]; the head is at rest if it does not turn."""
    chosen = posture_set()[rng.choice(len(posture_set()), MOVEMENTS + 1, replace=False)].copy()
    if not head_turns:
        chosen[:, HEAD] = chosen[0, HEAD]
    return chosen


class Scene:
    """An arm before a camera, another hand, and what the joints wrongly expect.

    Args:
        arm: its kinematics.
        seed: of all that is random.
        away: by how much the expected pose is off [m, rad].
    """

    def __init__(
        self, arm: ArmKinematics, seed: int, away: tuple[float, float] = (0.1, np.radians(10.0))
    ) -> None:
        self.arm, self.rng = arm, np.random.default_rng([seed, 5])
        self.off = np.concatenate([size * direction(self.rng) for size in away])
        self.own = OwnHand()

    def hand(self, q: Floats) -> Floats:
        """The own hand in the camera."""
        return self.arm.pose("hand", q, relative_to="eye")

    def expected(self, q: Floats) -> ExpectedPoses:
        return ExpectedPoses(displaced(self.hand(q), self.off), self.arm.pose("eye", q))

    def detected(self, pose: Floats) -> HandDetection:
        error = DEVIATION * self.rng.standard_normal(6)
        return HandDetection(displaced(pose, error), np.diag(DEVIATION**2))

    def choose(self, q: Floats, *poses: Floats) -> int | HandSkip:
        """Number of the pose that is chosen, of those that are seen in a random order."""
        order = self.rng.permutation(len(poses))
        hands = [self.detected(poses[k]) for k in order]
        found = self.own.choose(hands, self.expected(q))
        if isinstance(found, HandSkip):
            return found
        return int(order[next(k for k, hand in enumerate(hands) if hand is found)])


def still(scene: Scene, path: Floats) -> list[Floats]:
    """In the world, within the view at the begin."""
    there = scene.arm.pose("eye", path[0]) @ displaced(scene.hand(path[0]), aside(scene.rng))
    return [np.linalg.inv(scene.arm.pose("eye", q)) @ there for q in path]


def aside(rng: np.random.Generator, far: float = 0.2) -> Floats:
    return np.concatenate([far * direction(rng), rng.uniform(0.3, 2.0) * direction(rng)])


def nearer(scene: Scene, path: Floats) -> list[Floats]:
    """In the world, at first exactly where the own hand is expected."""
    there = scene.arm.pose("eye", path[0]) @ scene.expected(path[0]).hand
    return [np.linalg.inv(scene.arm.pose("eye", q)) @ there for q in path]


def by_itself(scene: Scene, path: Floats) -> list[Floats]:
    """As another arm of the same kind moves, which does not move with this one."""
    return [displaced(scene.hand(q), aside(scene.rng, 0.1)) for q in postures(scene.rng)]


def on_the_head(scene: Scene, path: Floats) -> list[Floats]:
    """Always at the same place of the frame, as a picture on the lens."""
    return [displaced(scene.hand(path[0]), aside(scene.rng))] * len(path)


OTHERS = [still, nearer, by_itself, on_the_head]
Other = Callable[[Scene, Floats], list[Floats]]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("head_turns", [True, False])
@pytest.mark.parametrize("other", OTHERS)
def test_the_hand_that_moves_as_the_joints_do_is_the_own_one(
    arm: ArmKinematics, other: Other, head_turns: bool, seed: int
) -> None:
    scene = Scene(arm, seed)
    path = postures(scene.rng, head_turns)
    found = [
        scene.choose(q, scene.hand(q), pose)
        for q, pose in zip(path, other(scene, path), strict=True)
    ]
    assert found[0] is HandSkip.TWICE
    assert set(found) <= {0, HandSkip.TWICE}
    assert found[-1] == 0
    assert scene.own.known


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("other", OTHERS)
def test_a_hand_that_is_alone_and_does_not_move_with_the_joints_is_rejected(
    arm: ArmKinematics, other: Other, seed: int
) -> None:
    scene = Scene(arm, seed)
    path = postures(scene.rng)
    found = [scene.choose(q, pose) for q, pose in zip(path, other(scene, path), strict=True)]
    assert found[0] == 0
    assert found[-1] is HandSkip.ANOTHER


@pytest.mark.parametrize("seed", SEEDS)
def test_a_hand_that_is_alone_is_believed_as_long_as_it_moves_with_the_joints(
    arm: ArmKinematics, seed: int
) -> None:
    scene = Scene(arm, seed)
    assert [scene.choose(q, scene.hand(q)) for q in postures(scene.rng)] == [0] * (MOVEMENTS + 1)
    assert scene.own.known


def test_a_hand_that_is_alone_is_believed_before_the_robot_has_learned(arm: ArmKinematics) -> None:
    """Each joint is off by 12 deg (rms), by errors that change within about a radian."""
    skipped = []
    for seed in SEEDS:
        scene, chosen = Scene(arm, seed), posture_set()
        waves = scene.rng.standard_normal((14, 14)) / np.sqrt(14.0)
        phases = scene.rng.uniform(0.0, 2.0 * np.pi, 14)
        for q in chosen[scene.rng.integers(len(chosen), size=30)]:
            wrong = q + np.radians(12.0) * np.sqrt(2.0) * np.sin(waves @ q + phases)
            expected = ExpectedPoses(scene.hand(wrong), arm.pose("eye", wrong))
            found = scene.own.choose([scene.detected(scene.hand(q))], expected)
            skipped.append(isinstance(found, HandSkip))
    assert np.mean(skipped) < 0.05


def known_with(scene: Scene, other: Other) -> tuple[Floats, list[Floats]]:
    """A path after which the own hand is known, with the poses of another one."""
    path = postures(scene.rng)
    poses = other(scene, path)
    for q, pose in zip(path, poses, strict=True):
        scene.choose(q, scene.hand(q), pose)
    assert scene.own.known
    return path, poses


@pytest.mark.parametrize("seed", SEEDS)
def test_the_own_hand_leaves_the_view_and_comes_back(arm: ArmKinematics, seed: int) -> None:
    scene = Scene(arm, seed)
    path, poses = known_with(scene, still)
    for q, pose in zip(path[:3], poses[:3], strict=True):
        assert scene.choose(q, pose) is HandSkip.ANOTHER
    assert scene.choose(path[4], scene.hand(path[4]), poses[4]) == 0
    assert scene.choose(path[5], scene.hand(path[5])) == 0


def test_a_hand_that_was_alone_is_ambiguous_while_another_one_may_be_the_own_one(
    arm: ArmKinematics,
) -> None:
    scene = Scene(arm, 0)
    path = postures(scene.rng)
    poses = still(scene, path)
    assert scene.choose(path[0], scene.hand(path[0]), poses[0]) is HandSkip.TWICE
    assert scene.choose(path[0], poses[0]) is HandSkip.TWICE


@pytest.mark.parametrize("other", [still, nearer])
def test_before_the_joints_move_nothing_is_known(arm: ArmKinematics, other: Other) -> None:
    scene = Scene(arm, 1)
    path = np.repeat(postures(scene.rng)[:1], 30, axis=0)
    for q, pose in zip(path, other(scene, path), strict=True):
        assert scene.choose(q, scene.hand(q), pose) is HandSkip.TWICE


def test_two_hands_that_both_move_with_the_joints_stay_ambiguous(arm: ArmKinematics) -> None:
    scene = Scene(arm, 2)
    path, change = postures(scene.rng), np.array([0.15, 0.1, 0.0, 0.0, 0.0, 0.0])
    for q in path:
        assert scene.choose(q, scene.hand(q), displaced(scene.hand(q), change)) is HandSkip.TWICE


@pytest.mark.parametrize("seed", SEEDS)
def test_a_hand_that_was_believed_wrongly_is_unlearned(arm: ArmKinematics, seed: int) -> None:
    """Another hand moved with the joints for a while, then stays where it is."""
    scene = Scene(arm, seed)
    path, change = postures(scene.rng), np.array([0.15, 0.1, 0.0, 0.0, 0.0, 0.0])
    for q in path:
        scene.choose(q, displaced(scene.hand(q), change))
    assert scene.own.known
    last = displaced(scene.hand(path[-1]), change)
    there = scene.arm.pose("eye", path[-1]) @ last
    found = [
        scene.choose(q, np.linalg.inv(scene.arm.pose("eye", q)) @ there, scene.hand(q))
        for q in (*path, *postures(scene.rng))
    ]
    assert found[-1] == 1


def test_one_pose_that_is_measured_wrong_decides_nothing(arm: ArmKinematics) -> None:
    scene = Scene(arm, 3)
    path, poses = known_with(scene, still)
    wrong = displaced(scene.hand(path[0]), np.array([0.3, 0.2, 0.1, 1.0, -1.0, 1.0]))
    assert scene.choose(path[0], wrong, poses[0]) is HandSkip.ANOTHER
    assert scene.choose(path[1], scene.hand(path[1]), poses[1]) == 0


def test_another_map_expects_the_hand_elsewhere_without_a_movement(arm: ArmKinematics) -> None:
    scene = Scene(arm, 4)
    path = postures(scene.rng)
    poses = still(scene, path)
    for k, (q, pose) in enumerate(zip(path, poses, strict=True)):
        last = scene.choose(q, scene.hand(q), pose)
        before = scene.expected(q)
        scene.off = np.concatenate([0.1 * direction(scene.rng), 0.17 * direction(scene.rng)])
        scene.own.map_changed(before, scene.expected(q))
        assert last in (0, HandSkip.TWICE), k
    assert last == 0


def test_the_same_frames_have_the_same_result_and_a_copy_continues_as_the_original(
    arm: ArmKinematics,
) -> None:
    def run(copies: bool) -> list[int | HandSkip]:
        scene = Scene(arm, 5)
        path, found = postures(scene.rng), []
        for q, pose in zip(path, still(scene, path), strict=True):
            if copies:
                scene.own = deepcopy(scene.own)
            found.append(scene.choose(q, scene.hand(q), pose))
        return found

    assert run(False) == run(False) == run(True)


def test_a_copy_is_independent_and_an_episode_begins_without_knowledge(arm: ArmKinematics) -> None:
    scene = Scene(arm, 6)
    known_with(scene, still)
    copy = deepcopy(scene.own)
    copy.reset()
    assert scene.own.known
    assert not copy.known


@pytest.mark.parametrize("seed", SEEDS)
def test_by_positions_alone_no_other_hand_is_chosen(arm: ArmKinematics, seed: int) -> None:
    """They show little: where a hand turns much, its displacement is hardly predicted."""
    scene = Scene(arm, seed)
    path = postures(scene.rng)
    covariance = np.diag(np.append(DEVIATION[:3] ** 2, [1e4] * 3))
    for q, pose in zip(path, still(scene, path), strict=True):
        poses = [scene.detected(each).pose_hand_in_camera for each in (scene.hand(q), pose)]
        hands = [HandDetection(each, covariance) for each in poses]
        found = scene.own.choose(hands, scene.expected(q))
        assert found is hands[0] or found is HandSkip.TWICE


FRAME = np.full((4, 4, 3), 90, dtype=np.uint8)


class FakeHands:
    """Detector that finds the hands that it is given."""

    frame = "hand"

    def __init__(self) -> None:
        self.found: tuple[HandDetection, ...] | HandSkip = ()

    def __deepcopy__(self, memo: dict[int, object]) -> FakeHands:
        return self

    def hands(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> tuple[HandDetection, ...] | HandSkip:
        return self.found

    def detect(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> HandDetection | HandSkip:
        raise AssertionError("all hands are asked for")

    def shows(self, pose: np.ndarray) -> bool:
        return True


@pytest.mark.parametrize("seed", SEEDS)
def test_the_finder_chooses_with_joints_that_are_off(arm: ArmKinematics, seed: int) -> None:
    """Joint angles that are wrong by a constant are no constant error of the pose."""
    scene, detector = Scene(arm, seed), FakeHands()
    assert isinstance(detector, HandsDetector)
    finder = HandShape(detector, None, arm, "eye")
    path = postures(scene.rng)
    wrong = np.radians(4.0) * scene.rng.standard_normal(14)
    for q, pose in zip(path, still(scene, path), strict=True):
        detector.found = scene.detected(pose), scene.detected(scene.hand(q))
        found = finder.find(FRAME.copy(), q + wrong).hand
        assert isinstance(found, HandSeen) or found == HandMissed(
            "doubled", f"the hand was not seen: {HandSkip.TWICE.value}"
        )
    assert isinstance(found, HandSeen)
    np.testing.assert_allclose(found.pose, detector.found[1].pose_hand_in_camera, atol=1e-12)
    detector.found = (detector.found[0],)
    assert finder.find(FRAME.copy(), path[-1] + wrong).hand == HandMissed(
        "absent", f"the hand was not seen: {HandSkip.ANOTHER.value}"
    )
    detector.found = ()
    assert finder.find(FRAME.copy(), path[-1] + wrong).hand == HandMissed(
        "absent", f"the hand was not seen: {HandSkip.NOT_SEEN.value}"
    )


def test_a_search_in_another_thread_changes_nothing_that_is_remembered(arm: ArmKinematics) -> None:
    scene, detector = Scene(arm, 8), FakeHands()
    finder = HandShape(detector, None, arm, "eye")
    path = postures(scene.rng)
    detector.found = (scene.detected(scene.hand(path[0])),)
    for q in path:
        finder.find_at(FRAME, finder.pose(q))
    assert finder.find(FRAME, path[0]).hand is not None
    assert isinstance(finder.find(FRAME, path[0]).hand, HandSeen)


def test_a_difference_is_that_of_the_covariance() -> None:
    change = np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.1])
    assert difference(displaced(np.eye(4), change), np.eye(4)) == pytest.approx(change)


@pytest.mark.parametrize("movement", [0.03, 0.04, 0.1])
def test_a_still_hand_is_not_the_own_one_even_if_that_moved_little(movement: float) -> None:
    start, moved_on = np.eye(4), np.eye(4)
    start[2, 3] = moved_on[2, 3] = 0.5
    moved_on[0, 3] = movement
    still = HandDetection(start, np.diag(DEVIATION**2))
    before = Sample(still, ExpectedPoses(start, np.eye(4)))
    stayed = Sample(still, ExpectedPoses(moved_on, np.eye(4)))
    went = Sample(HandDetection(moved_on, still.covariance), stayed.expected)
    assert explain(before, stayed).evidence < -1.0
    assert explain(before, went).evidence > 1.0
