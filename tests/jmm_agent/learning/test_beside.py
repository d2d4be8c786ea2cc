"""Learning beside the control loop: the same bits wherever it runs, and nothing lost in silence."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.agent_log import RecordedAgent
from jmm_agent.errors import AgentError
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.options import AS_SOON, LearningOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import Detections, MarkerPose
from tests.jmm_agent.nominal_arm import ARM, JOINTS, posture_set, trained_map

START, FIRST, SECOND, THIRD = posture_set()[:4]
MISTAKE = np.radians([1, -1, 1, 4, -4, 3, 4, -8, 7, 8, -7, 3, -3, 2])
FRAME = np.full((480, 640, 3), 90, dtype=np.uint8)
CALM = np.full(36, 50.0)
RESTS = (FIRST, SECOND, THIRD)
STEPS = 36  # of each rest


@pytest.fixture(scope="module")
def nominal_map(request: pytest.FixtureRequest) -> JointMuscleMap:
    return trained_map(request)


@pytest.fixture(scope="module")
def arm() -> ArmKinematics:
    return ArmKinematics(ARM, JOINTS)


class Detector:
    """Returns the exact pose of the marker of the posture that is written in the frame."""

    def __init__(self, arm: ArmKinematics) -> None:
        self._poses = [arm.pose("marker_hand", q, relative_to="eye") for q in posture_set()[:6]]

    def detect(self, frame: np.ndarray, expected: object = None) -> Detections:
        pose = self._poses[frame[0, 0, 0]]
        return Detections({0: MarkerPose(0, pose, np.zeros((4, 2)), 0.0, pose, 9.0)}, {}, ())


class FaultyGuard(NullGuard):
    """Notices a fault when a test says so."""

    take_back = 1.0
    noticed = False

    def watch(self, readings: SensorReadings, state: object) -> bool:
        noticed, self.noticed = self.noticed, False
        return noticed


Make = Callable[..., Agent]


@pytest.fixture
def make(nominal_map: JointMuscleMap, arm: ArmKinematics) -> Iterator[Make]:
    """Makes agents, and ends what they run beside."""
    agents = []

    def made(where: Any = "step", enters_after: int = 0, **more: Any) -> Agent:
        options = AgentOptions(learning=LearningOptions(where, enters_after, 300.0))
        rng = np.random.default_rng(3)
        detector = Detector(arm)
        agent = Agent(nominal_map, arm, detector, posture_set(), START, rng, options, **more)
        agent.begin_episode()
        agents.append(agent)
        return agent

    yield made
    for agent in agents:
        agent.close()


def readings(nominal_map: JointMuscleMap, step: int, posture: int) -> SensorReadings:
    """Of a robot whose lengths were zeroed at another posture, at rest."""
    lengths = nominal_map.lengths(posture_set()[posture]) - nominal_map.lengths(MISTAKE)
    frame = FRAME.copy()
    frame[0, 0, 0] = posture
    return SensorReadings(0.02 * step, lengths, CALM, frame, 0.2 * (step // 10))


def run(agent: Any, nominal_map: JointMuscleMap, rests: int = 2, begin: int = 0) -> list[Floats]:
    """Rest at some postures; the commands."""
    steps = range(begin, begin + rests * STEPS)
    return [agent.step(readings(nominal_map, k, 1 + k // STEPS % 5)) for k in steps]


def rest_until_pending(agent: Agent, nominal_map: JointMuscleMap) -> int:
    """Rest until there is a job; the number of the next step."""
    step = 0
    while not agent._schedule.pending:
        agent.step(readings(nominal_map, step, 1))
        step += 1
    return step


def learned(agent: Agent) -> list[bytes]:
    """All that was learned, as bytes."""
    layers = [part for group in agent.map.groups for part in (group.W2, group.b2)]
    vision = agent.vision.memory
    return [part.tobytes() for part in (*layers, *vision.pairs, vision.angles)]


@pytest.mark.parametrize("enters_after", [0, 4])
def test_learning_in_a_process_has_the_same_bits_as_in_the_step(
    enters_after: int, make: Make, nominal_map: JointMuscleMap
) -> None:
    step, process = make("step", enters_after), make("process", enters_after)
    for one, other in zip(run(step, nominal_map), run(process, nominal_map), strict=True):
        np.testing.assert_array_equal(one, other)
    assert learned(step) == learned(process)
    assert step.entered == process.entered
    assert step.vision.fired == 2


def test_a_result_enters_the_stated_number_of_steps_later(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    now, later = make("step", 0), make("step", 7)
    for agent in (now, later):
        run(agent, nominal_map, 1)
    at = {end.kind: end.step for end in now.entered}
    frame, antagonism, vision = later.entered
    assert antagonism.kind == "antagonism"
    assert antagonism.step == at["antagonism"] + 7
    assert frame.step == antagonism.step  # both began at the same step
    assert vision.step == frame.step + 7
    np.testing.assert_allclose(later.map.lengths(SECOND), now.map.lengths(SECOND), atol=1e-4)


def test_the_log_of_a_live_run_is_repeated_to_the_bit(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    live, repeated = make("process", AS_SOON), make("step", AS_SOON)
    recorded: Any = RecordedAgent(live)
    commands = []
    for k in range(2 * STEPS):
        if k == STEPS:
            recorded.go(THIRD, 0.5)
        commands.append(recorded.step(readings(nominal_map, k, 1 + k // STEPS)))
        while k % STEPS > STEPS - 9 and live._schedule.late:
            sleep(0.01)  # the steps of this test are shorter than those of a robot
    recorded.finish_learning()
    assert live.vision.fired == 2
    np.testing.assert_array_equal(commands, recorded.log.replay(repeated))
    assert learned(live) == learned(repeated)
    assert live.entered == repeated.entered


class BrokenRule:
    """Rule that fails."""

    def move(self, current: object, remembered: object, batch: object) -> JointMuscleMap:
        raise ZeroDivisionError("no rule")


@pytest.mark.parametrize("where", ["step", "process"])
def test_a_job_that_fails_is_named_and_the_loop_goes_on(
    where: str, make: Make, nominal_map: JointMuscleMap
) -> None:
    agent = make(where, 2, rule=BrokenRule())
    run(agent, nominal_map, 1)
    assert agent.vision.dropped == {"learning failed: ZeroDivisionError: no rule": 2}
    assert agent.map is nominal_map
    assert [end.failure for end in agent.entered if end.kind != "frame"] == (
        ["ZeroDivisionError: no rule"] * 2
    )


def test_a_killed_process_is_named_and_replaced(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = make("process", 3)
    run(agent, nominal_map, 1)
    begin = monotonic()
    assert agent._schedule.process_id is not None
    os.kill(agent._schedule.process_id, signal.SIGKILL)
    run(agent, nominal_map, 2, STEPS)
    assert monotonic() - begin < 240.0
    killed = "learning failed: the process was killed by signal 9"
    assert agent.vision.dropped == {killed: 1}
    assert agent.vision.fired == 3


def test_a_fault_takes_back_what_has_not_entered_yet(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    guard = FaultyGuard()
    agent = make("step", 50, guard=guard)
    step = rest_until_pending(agent, nominal_map)
    guard.noticed = True
    agent.step(readings(nominal_map, step, 1))
    assert not agent._schedule.pending
    assert agent.taken_back == 1
    assert agent.vision.dropped == {}
    assert agent.map is nominal_map


def pending(make: Make, nominal_map: JointMuscleMap) -> Agent:
    agent = make("step", 10)
    rest_until_pending(agent, nominal_map)
    assert agent._schedule.pending
    return agent


def test_switching_learning_off_drops_what_has_not_entered_yet(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    agent = pending(make, nominal_map)
    before = agent.map
    agent.learning = False
    run(agent, nominal_map, 1, STEPS)
    assert agent.map is before
    assert sum(agent.vision.dropped.values()) == 1
    assert "switched off" in next(iter(agent.vision.dropped))


def test_a_recall_drops_what_has_not_entered_yet(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = pending(make, nominal_map)
    agent.recall(nominal_map, agent.antagonism.memory, agent.vision.memory)
    assert not agent._schedule.pending
    assert "another time" in next(iter(agent.vision.dropped))


def test_an_episode_ends_only_when_all_is_learned(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = pending(make, nominal_map)
    assert not agent.at_rest
    agent.begin_episode()
    assert agent.antagonism.fired == 1
    assert agent.vision.dropped == {}


def test_the_map_stays_while_the_hand_holds_something(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    agent = pending(make, nominal_map)
    before, agent.hand_is_free = agent.map, False
    run(agent, nominal_map, 1, STEPS)
    assert agent.map is before
    agent.hand_is_free = True
    run(agent, nominal_map, 1, 2 * STEPS)
    assert agent.antagonism.fired >= 1
    assert agent.vision.dropped == {}


def test_a_third_job_at_once_is_counted(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = make("step", 400)
    run(agent, nominal_map, 3)
    assert agent.vision.fired == 0
    assert agent.vision.dropped["learning was busy with earlier observations"] >= 1


def test_a_frame_of_the_wrong_shape_is_named(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = make("process", 2)
    frames = (
        readings(nominal_map, k, 1)._replace(frame=np.full((4, 4, 3), 77, np.uint8))
        for k in range(STEPS)
    )
    with pytest.raises(AgentError, match="IndexError"):
        [agent.step(frame) for frame in frames]


def test_a_rule_that_no_process_can_load_is_refused(make: Make) -> None:
    class Local(BrokenRule):
        """Not importable."""

    with pytest.raises(AgentError, match="can be imported"):
        make("process", 0, rule=Local())


@pytest.mark.parametrize("bad", [{"where": "cloud"}, {"enters_after": -2}, {"timeout": 0.0}])
def test_bad_options_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(AgentError, match="LearningOptions: " + next(iter(bad))):
        LearningOptions(**bad)


def test_a_fault_noticed_later_takes_back_what_entered(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    guard = FaultyGuard()
    agent = make("step", 2, guard=guard)
    run(agent, nominal_map, 1)
    assert agent.vision.fired == 1
    guard.noticed = True
    agent.step(readings(nominal_map, STEPS, 1))
    assert agent.taken_back == 1
    assert agent.map is nominal_map
