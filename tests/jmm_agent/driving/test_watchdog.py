"""The watchdog on the driver's side."""

from __future__ import annotations

import pytest

from jmm_agent.driving.watchdog import Watchdog


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def watchdog(clock: Clock) -> Watchdog:
    return Watchdog(0.02, 4, clock)


def test_it_expires_after_its_periods_without_a_command(watchdog: Watchdog, clock: Clock) -> None:
    assert watchdog.command(0)
    clock.now = 0.079
    assert not watchdog.expired
    clock.now = 0.08
    assert watchdog.expired


def test_fresh_commands_keep_it_from_expiring(watchdog: Watchdog, clock: Clock) -> None:
    for number in range(100):
        clock.now = 0.05 * number
        assert watchdog.command(number)
    assert not watchdog.expired


def test_it_stays_expired_until_it_is_reset(watchdog: Watchdog, clock: Clock) -> None:
    watchdog.command(0)
    clock.now = 1.0
    assert not watchdog.command(1)
    watchdog.pause()
    assert watchdog.expired
    watchdog.reset()
    assert watchdog.command(0)
    assert not watchdog.expired


def test_repeated_and_overtaken_commands_are_not_fresh(watchdog: Watchdog, clock: Clock) -> None:
    assert watchdog.command(7)
    clock.now = 0.06
    assert not watchdog.command(7)
    assert not watchdog.command(3)
    clock.now = 0.08
    assert watchdog.expired


def test_it_waits_for_the_first_command_and_during_a_pause(
    watchdog: Watchdog, clock: Clock
) -> None:
    clock.now = 100.0
    assert not watchdog.expired
    watchdog.command(0)
    watchdog.pause()
    clock.now = 200.0
    assert not watchdog.expired
    watchdog.command(1)
    clock.now = 201.0
    assert watchdog.expired


@pytest.mark.parametrize(
    ("period", "periods"), [(0.0, 4), (float("nan"), 4), (0.02, 0), (0.02, float("inf"))]
)
def test_a_watchdog_that_would_never_expire_is_refused(period: float, periods: float) -> None:
    with pytest.raises(ValueError, match="positive and finite"):
        Watchdog(period, periods)
