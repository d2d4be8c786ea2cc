"""Garbage collections and threads beside a control loop."""

import gc
import sys
import weakref

import pytest

from jmm_agent.driving.short_pauses import short_pauses


class Knot:
    """An object that refers to itself, so that only the collector frees it."""

    def __init__(self) -> None:
        self.own = self


def test_what_exists_before_is_left_out_and_what_is_made_within_is_collected() -> None:
    older = Knot()
    before = weakref.ref(older)
    with short_pauses():
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


@pytest.mark.parametrize("own", [5e-3, 2e-4])
def test_threads_that_compute_yield_within_a_tenth_of_a_step(own: float) -> None:
    """A longer interval of the caller is shortened meanwhile, a shorter one stays."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(own)
    try:
        with short_pauses():
            assert sys.getswitchinterval() == pytest.approx(min(own, 5e-4), rel=0.02)
        assert sys.getswitchinterval() == pytest.approx(own, rel=0.02)
    finally:
        sys.setswitchinterval(before)


def test_an_error_ends_it() -> None:
    interval = sys.getswitchinterval()
    with pytest.raises(KeyError), short_pauses():
        raise KeyError
    assert gc.get_freeze_count() == 0
    assert sys.getswitchinterval() == interval


def test_contexts_that_overlap_share_the_settings_until_the_last_ends() -> None:
    interval = sys.getswitchinterval()
    first, second = short_pauses(), short_pauses()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert sys.getswitchinterval() == pytest.approx(5e-4, rel=0.02)
    assert gc.get_freeze_count() > 0
    second.__exit__(None, None, None)
    assert sys.getswitchinterval() == interval
    assert gc.get_freeze_count() == 0


def test_what_the_caller_has_frozen_stays_so() -> None:
    gc.freeze()
    try:
        with short_pauses():
            pass
        assert gc.get_freeze_count() > 0
    finally:
        gc.unfreeze()
