"""Garbage collections within a control loop."""

import gc
import weakref

import pytest

from jmm_agent.driving.short_collections import short_collections


class Knot:
    """An object that refers to itself, so that only the collector frees it."""

    def __init__(self) -> None:
        self.own = self


def test_what_exists_before_is_left_out_and_what_is_made_within_is_collected() -> None:
    older = Knot()
    before = weakref.ref(older)
    with short_collections():
        assert gc.get_freeze_count() > 0
        del older
        newer = Knot()
        within = weakref.ref(newer)
        del newer
        gc.collect()
        assert before() is not None
        assert within() is None
    gc.collect()
    assert before() is None


def test_an_error_ends_it() -> None:
    with pytest.raises(KeyError), short_collections():
        raise KeyError
    assert gc.get_freeze_count() == 0
