"""The benchmark of an online update: torch is said to be missing, and ends in our numbers."""

from __future__ import annotations

import sys

import pytest

from benchmarks import online_update
from tests.jmm_agent.small_map import make_map, postures


def test_torch_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(SystemExit, match=r"^This benchmark needs torch, .* 'kengoro\[rl\]'\.$"):
        online_update.main()


@pytest.mark.slow
@pytest.mark.torch
@pytest.mark.parametrize("steps", [1, 10])
def test_torch_in_float64_ends_in_our_numbers(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(online_update, "TIMED", 3)
    monkeypatch.setattr(online_update, "posture_set", lambda: postures(50, 3))
    seconds, apart = online_update.measure(make_map(0), steps)
    assert apart["float64"] < 1e-9 < apart["float32"]
    assert {who: len(taken) for who, taken in seconds.items()} == dict.fromkeys(
        ("ours", "float64", "float32"), 3
    )
