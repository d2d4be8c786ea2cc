"""Benchmark of an online update: every rule is timed, and both ways to run torch are compared."""

from __future__ import annotations

import pytest

from benchmarks import online_update
from jmm_agent.mapping.torch_process import shared
from tests.jmm_agent.small_map import make_map, postures

pytestmark = pytest.mark.torch


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(online_update, "TIMED", 3)
    monkeypatch.setattr(online_update, "posture_set", lambda: postures(50, 3))


def test_every_update_is_timed() -> None:
    start = make_map(0)
    seconds = online_update.measure(start, online_update.updates_of(start))
    shared().close()
    assert len(seconds) == 2 * len(online_update.STEPS) + 1
    assert {len(times) for times in seconds.values()} == {3}
    assert all(time > 0.0 for times in seconds.values() for time in times)


def test_different_bits_are_found() -> None:
    start = make_map(0)
    updates = dict(online_update.updates_of(start))
    ridge = updates["ridge rule"]
    with pytest.raises(AssertionError, match="10 steps: the processes have different bits"):
        online_update.measure(start, {**updates, "paper's rule, 10 steps": ridge})
    shared().close()
