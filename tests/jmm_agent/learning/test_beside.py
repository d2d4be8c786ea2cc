"""Learning beside the control loop: the same bits wherever it runs, and nothing lost unnamed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.errors import AgentError
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.learning.options import LearningOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.mapping.torch_process import shared
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.learning.resting import (
    SECOND,
    STEPS,
    Make,
    learned,
    readings,
    rest_until_pending,
    run,
)


class FaultyGuard(NullGuard):
    """Notices a fault when a test sets `noticed`."""

    take_back = 1.0
    noticed = False

    def watch(self, readings: SensorReadings, state: object) -> bool:
        noticed, self.noticed = self.noticed, False
        return noticed


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


@pytest.mark.slow
def test_the_papers_rule_has_the_same_bits_in_a_process(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    agents = [make(where, 2, rule=MinibatchRule(steps=3)) for where in ("step", "process")]
    for agent in agents:
        run(agent, nominal_map, 1)
        assert agent.vision.dropped == {}
    step, process = agents
    assert learned(step) == learned(process)
    assert not np.array_equal(step.map.groups[0].W1, nominal_map.groups[0].W1)
    here = shared().process_id  # of "step"; that of "process" is one of the other process
    assert here is not None
    step.close()
    assert shared().process_id is None


def test_the_ridge_rule_starts_no_torch(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = make("step")
    run(agent, nominal_map, 1)
    assert agent.vision.fired == 1
    assert shared().process_id is None


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
