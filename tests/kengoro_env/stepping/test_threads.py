"""Threads that help with the steps of many robots stay, sleep and end."""

from __future__ import annotations

import gc
import multiprocessing
import time
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest

from kengoro_env.stepping.compiled_steps import CompiledSteps
from kengoro_env.types import Floats
from kengoro_env.vector import KengoroVectorEnv

ACTIONS = np.full((6, 3), 0.4, dtype=np.float32)


def make(threads: int) -> KengoroVectorEnv:
    """Six elbows, stepped twice."""
    many = KengoroVectorEnv(6, "elbow", robot_seed=3, threads=threads)
    if not isinstance(many.fleet, CompiledSteps):
        pytest.skip("there is no compiled code here")
    many.reset(seed=0)
    for _ in range(2):
        many.step(ACTIONS)
    return many


def running() -> int:
    """Number of threads of this process."""
    return len(list(Path("/proc/self/task").iterdir()))


def angles(many: KengoroVectorEnv) -> Floats:
    """Joint angles after three more steps."""
    for _ in range(2):
        many.step(ACTIONS)
    found: Floats = many.step(ACTIONS)[4]["joint_angles"]
    return found


def test_threads_stay_between_steps_and_end_with_the_environment() -> None:
    gc.collect()
    before = running()
    many = make(threads=3)
    assert running() == before + 2
    many.step(ACTIONS)
    assert running() == before + 2
    del many
    gc.collect()
    for _ in range(100):  # the system forgets a thread a little after its end
        if running() == before:
            break
        time.sleep(0.05)
    assert running() == before


def test_threads_sleep_while_there_is_nothing_to_step() -> None:
    many = make(threads=3)
    time.sleep(0.05)
    start = time.process_time()
    time.sleep(0.5)
    assert time.process_time() - start < 0.1  # of one second, were both of them awake
    assert np.isfinite(angles(many)).all()  # and they wake up


def step_in_fork(many: list[KengoroVectorEnv], pipe: Connection) -> None:
    """Step the first of those made before the fork, and delete both."""
    alone = running()
    found = angles(many[0])
    pipe.send((found, running() - alone))
    many.clear()
    gc.collect()
    pipe.send("deleted")


def test_a_fork_has_threads_of_its_own() -> None:
    many = [make(threads=3) for _ in range(2)]
    receiver, sender = multiprocessing.Pipe(duplex=False)
    fork = multiprocessing.get_context("fork").Process(target=step_in_fork, args=(many, sender))
    fork.start()
    try:
        assert receiver.poll(30.0)
        found, started = receiver.recv()
        assert receiver.poll(10.0)
        fork.join(30.0)
        assert fork.exitcode == 0
    finally:
        fork.kill()
    assert started == 2
    assert np.array_equal(found, angles(many[0]))
