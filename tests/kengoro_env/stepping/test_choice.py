"""The number of threads follows from the work of a step."""

from __future__ import annotations

from typing import Any

import pytest

from kengoro_env.stepping import choice
from kengoro_env.stepping.compiled_steps import CompiledSteps
from kengoro_env.vector import KengoroVectorEnv


def threads_of(task: str, count: int, cores: int, **more: Any) -> int:
    """Number of threads of a vector environment on a machine with so many cores."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choice, "cores", lambda: cores)
        many = KengoroVectorEnv(count, task, **more)
    if not isinstance(many.fleet, CompiledSteps):
        pytest.skip("there is no compiled code here")
    return int(many.fleet._fleet.threads)


def test_a_few_whole_arms_use_all_cores() -> None:
    """Each step of one is ten times the cost of a thread."""
    assert [threads_of("posture", count, 4) for count in (1, 2, 4)] == [1, 2, 4]
    assert threads_of("posture", 2, 1) == 1


def test_a_few_elbows_use_fewer_threads_than_many() -> None:
    assert [threads_of("elbow", count, 4) for count in (1, 2, 4, 8)] == [1, 1, 2, 4]
    assert threads_of("elbow", 8, 2) == 2


def test_a_robot_that_stretches_and_a_longer_step_are_more_work() -> None:
    assert threads_of("elbow", 2, 4, control_period=0.1) == 2
    assert threads_of("elbow", 3, 4) < threads_of("elbow", 3, 4, robot_seed=1)


def test_the_user_may_choose() -> None:
    assert threads_of("posture", 2, 4, threads=1) == 1
