"""The benchmark of many environments."""

from __future__ import annotations

from benchmarks import many_envs


def test_it_has_a_few_environments_and_many() -> None:
    assert {1, 2, 4, 8, 64} <= set(many_envs.COUNTS)
