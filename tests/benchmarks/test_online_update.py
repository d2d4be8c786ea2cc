"""Benchmark of an online update: missing torch is reported, and torch gets the same weights."""

from __future__ import annotations

import sys

import pytest

from benchmarks import online_update
from tests.jmm_agent.small_map import make_map, postures


def test_missing_torch_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(SystemExit, match=r"^This benchmark needs torch, .* 'kengoro\[rl\]'\.$"):
        online_update.main()


@pytest.mark.slow
@pytest.mark.torch
@pytest.mark.parametrize("steps", [1, 10])
def test_torch_in_float64_gets_the_same_weights(
    steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(online_update, "TIMED", 3)
    monkeypatch.setattr(online_update, "posture_set", lambda: postures(50, 3))
    seconds, differences = online_update.measure(make_map(0), steps)
    assert differences["float64"] < 1e-9 < differences["float32"]
    assert {version: len(times) for version, times in seconds.items()} == dict.fromkeys(
        ("ours", "float64", "float32"), 3
    )
