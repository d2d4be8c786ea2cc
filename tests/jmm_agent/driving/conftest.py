"""Drives that begin without a collection of the garbage of the whole test run."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="module")
def frozen(request: pytest.FixtureRequest) -> Iterator[None]:
    """A drive collects garbage once: 0.3 s with all that pytest has collected, if not frozen."""
    own = request.module.__name__.endswith("test_short_pauses")  # it counts frozen objects
    if not own:
        gc.freeze()
    yield
    if not own:
        gc.unfreeze()
