"""Rough search: when it is repeated with the slopes of the nominal model."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reality_gap.inference import rough_search
from reality_gap.inference.forward_selection import Settings

COUNT = 8


def outcome(variance: float, left: float, relinearised: bool) -> Any:
    ones = np.ones(COUNT)
    noise_model = SimpleNamespace(
        variance=variance * ones, inflation=ones, tolerances=np.zeros((COUNT, 0))
    )
    return SimpleNamespace(
        problem=SimpleNamespace(noise_model=noise_model),
        best=SimpleNamespace(residual=left * ones),
        relinearised=relinearised,
        stop=None,
        singles=(),
    )


@pytest.mark.parametrize(
    ("variance", "nominal", "expected", "searches"),
    [(1.5, 1.0, 3.0, 1), (4.0, 1.0, 1.0, 2), (4.0, 5.0, 3.0, 2)],
)
def test_slopes_of_the_nominal_model_are_tried_where_much_is_left(
    monkeypatch: pytest.MonkeyPatch,
    variance: float,
    nominal: float,
    expected: float,
    searches: int,
) -> None:
    calls = []

    def search(*_: Any, relinearise: bool = True) -> Any:
        calls.append(relinearise)
        return outcome(variance, 3.0 if relinearise else nominal, relinearise)

    monkeypatch.setattr(rough_search, "search", search)
    monkeypatch.setattr(rough_search, "independent_noise", lambda *_: None)
    monkeypatch.setattr(rough_search, "Problem", lambda *_: None)
    monkeypatch.setattr(rough_search, "roughness", lambda *_: 1.0)
    joint = SimpleNamespace(instead=None, after=lambda _, result: result)
    monkeypatch.setattr(rough_search, "JointSearch", lambda _: joint)
    replayer: Any = SimpleNamespace(measured=None)

    columns = np.zeros((COUNT, 0))
    found = rough_search.search_roughly(replayer, np.ones(COUNT), [], columns, [], Settings())

    assert float(found.best.residual[0]) == expected
    assert calls == [True, False][:searches]
