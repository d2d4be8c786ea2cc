"""Temper of confidences, from evidence with a known calibration."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from experiments.gap_calibrate.run import LARGEST, SMALLEST, calibrated, evidence_and_right, hide
from reality_gap.causes import find_cause
from reality_gap.causes.base import Location, Parameter
from reality_gap.inference.confidence import tempered
from reality_gap.simulation.hypothesis import Candidate

NAMES = ("delay", "payload", "slack")


def _trial(rng: np.random.Generator, temper: float) -> dict[str, Any]:
    """Candidates of which one is right as often as its tempered evidence states."""
    evidence = 10.0 + rng.uniform(0.0, 60.0) + rng.uniform(0.0, 12.0, len(NAMES))
    chances = tempered(evidence, temper)
    right = rng.choice(len(NAMES), p=chances / chances.sum())
    return {
        "truth": {"cause": NAMES[right]},
        "candidates": [[0, name, ["somewhere"], 0.0, 0.0] for name in NAMES],
        "evidence": list(evidence),
    }


@pytest.mark.parametrize("temper", [1.0, 4.0])
def test_it_finds_the_temper_that_keeps_its_word(temper: float) -> None:
    rng = np.random.default_rng(0)
    trials = [_trial(rng, temper) for _ in range(3000)]

    assert calibrated(trials) == pytest.approx(temper, rel=0.15)


def test_candidates_of_later_steps_do_not_count() -> None:
    trial = {
        "truth": {"cause": "delay"},
        "candidates": [
            [0, "delay", [], 0.0, 0.9],
            [0, "slack", [], 0.0, 0.1],
            [1, "delay", [], 0, 0],
        ],
        "evidence": [9.0, 2.0, 5.0],
    }

    evidence, right = evidence_and_right(trial)

    assert evidence.tolist() == [9.0, 2.0]
    assert right.tolist() == [True, False]


def test_without_evidence_no_candidate_is_likelier_than_none() -> None:
    np.testing.assert_allclose(tempered(np.zeros(3), 1.5), 0.25)


def test_hidden_causes_have_a_random_size_and_different_parameters() -> None:
    """As large in both directions, friction by direction would be plain friction."""
    names = ("forward", "backward")
    parameters = tuple(Parameter(name, "N", 3.0, 0.05, 0.0, 200.0) for name in names)
    tendon = Candidate(
        find_cause("direction_dependent_friction"), Location("tendon", ("flexor",)), parameters
    )

    for seed in range(20):
        _, values = hide(np.random.default_rng(seed), [tendon])
        small, large = sorted(values.values())

        assert 3.0 * SMALLEST <= large <= 3.0 * LARGEST
        assert 0.0 <= small < 0.999 * large
