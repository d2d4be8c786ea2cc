"""Wrong observations: which are wrong, by how much, and how their outcomes are counted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.wrong_observations.run import CONDITIONS, KINDS, Sizes, conclude, displaced, run

SIZES = Sizes(observations=8, first=3, every=2, tested=5)
SOME, FAR, LITTLE = KINDS


def test_kinds_take_turns() -> None:
    assert [SIZES.kind(k) for k in range(8)] == ["", "", "", SOME, "", FAR, "", LITTLE]
    assert [Sizes(first=1, every=1).kind(k) for k in (1, 4)] == [SOME, SOME]


def test_a_pose_is_displaced_by_as_much_as_it_should_be() -> None:
    pose, rng = np.eye(4), np.random.default_rng(0)
    moved = displaced(pose, 0.06, 0.4, rng, exactly=True)
    assert np.linalg.norm(moved[:3, 3]) == pytest.approx(0.06)
    assert Rotation.from_matrix(moved[:3, :3]).magnitude() == pytest.approx(0.4)
    np.testing.assert_array_equal(pose, np.eye(4))
    many = [displaced(pose, 0.01, 0.0, rng)[:3, 3] for _ in range(500)]
    assert np.std(many) == pytest.approx(0.01, rel=0.1)


def made_up(condition: str) -> dict[str, Any]:
    """Observations of one robot: without hold-out wrong ones double the error."""
    plain = condition == "plain"
    observations, error = [], 10.0
    for number in range(SIZES.observations):
        kind = SIZES.kind(number) if condition in ("plain", "tested") else ""
        after = error * (2.0 if kind and plain else 1.0 if kind else 0.9)
        outcome = "learned" if plain or not kind else "undone"
        observations.append({"wrong": kind, "outcome": outcome, "before": error, "after": after})
        error = after
    return {"observations": observations}


def test_harm_and_its_undoing_are_counted() -> None:
    result = {condition: made_up(condition) for condition in CONDITIONS}
    found = conclude({1: result, 2: result}, SIZES)

    assert found.metrics["worst_ratio_plain"]["median"] == 2.0
    assert found.metrics["worst_ratio_tested"] | {"paper": None} == {
        "unit": "", "paper": None, "median": 1.0, "worst": 1.0, "low": 1.0, "high": 1.0,
        "must": 1.2, "by": "median", "reached": True,
    }  # fmt: skip
    assert found.metrics["right_observations_undone"]["worst"] == 0.0
    rows = {(row[0], row[1]): row[2:] for row in found.tables[0].rows}
    assert rows["wrong observations, no hold-out", FAR] == [2, 0, 0, 0, 2, 2, "2.00"]
    assert rows["wrong observations, with hold-out", FAR] == [2, 0, 2, 0, 0, 0, "1.00"]
    assert rows["right observations only, with hold-out", "nothing"][:1] == [16]
    assert len(found.pictures[0].png) > 5000


def test_a_run_on_a_robot_follows_the_sizes(request: pytest.FixtureRequest) -> None:
    sizes = Sizes(observations=3, first=2, every=1, tested=4)
    observations = run("plain", 0, sizes, request.config.cache.mkdir("maps"))["observations"]
    assert [entry["wrong"] for entry in observations] == ["", "", SOME]
    assert observations[1]["after"] < observations[0]["before"]
    assert observations[1]["before"] == observations[0]["after"]
