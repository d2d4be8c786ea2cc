"""Changes of the muscles' stiffness: commands and gains go together, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.feed_forward import stretch
from jmm_agent.guard.faults import MotorControl
from jmm_agent.muscle_stiffness import MuscleStiffness
from jmm_agent.tension_distribution import TensionDistribution, TensionOptions
from tests.jmm_agent.small_map import JOINTS, make_map, postures
from tests.jmm_agent.test_tension_distribution import Weight

TENSIONS = np.array([30.0, 40.0, 60.0, 100.0, 130.0])
TARGET = postures(1)[0]


def control(rate: float = 0.03) -> MuscleStiffness:
    made = MuscleStiffness(5, rate)
    made.motors = MotorControl(30_000.0, 30.0, 500.0)
    return made


def change(made: MuscleStiffness, value: Any, **more: Any) -> Any:
    distribution = TensionDistribution(Weight(), TensionOptions())
    given = {"limits": None, "distribution": distribution, **more}
    return made.change(value, given["limits"], make_map(), TARGET, given["distribution"], TENSIONS)


@pytest.mark.parametrize("period", [0.005, 0.02, 0.05])
@pytest.mark.parametrize("goal", [3_000.0, 60_000.0])
def test_commands_and_gains_go_together_at_a_limited_speed(period: float, goal: float) -> None:
    made, jmm = control(), make_map()
    assert made.commanded is None
    change(made, goal)
    before, steps = stretch(jmm, made.known(), TENSIONS), 0
    while made.advance(period):
        motors = made.known()
        now = stretch(jmm, motors, TENSIONS)
        assert np.abs(now - before).max() <= 0.03 * period * (1.0 + 1e-9)
        measured = jmm.lengths(TARGET)
        np.testing.assert_allclose(motors.demanded(measured, measured - now), TENSIONS, rtol=1e-9)
        before, steps = now, steps + 1
    np.testing.assert_array_equal(made.commanded, np.full(5, goal))
    assert steps * period >= 0.2 - period
    assert not made.finish()


def test_a_second_change_goes_on_from_the_first() -> None:
    made = control()
    change(made, 3_000.0)
    for _ in range(10):
        made.advance(0.02)
    halfway = made.present()
    assert 3_000.0 < halfway[0] < 30_000.0
    change(made, np.linspace(10_000.0, 20_000.0, 5))
    np.testing.assert_array_equal(made.commanded, halfway)
    assert made.finish()
    np.testing.assert_allclose(made.commanded, np.linspace(10_000.0, 20_000.0, 5))


def test_wanted_joints_become_muscles() -> None:
    made = control()
    usual = change(made, 30_000.0)
    assert set(usual.joints) == set(JOINTS)
    wanted = {"b": 0.7 * usual.joints["b"]}
    found = change(made, wanted)
    assert found.wanted == wanted
    assert found.joints["b"] == pytest.approx(wanted["b"], rel=0.05)
    assert found.missed == ""
    low, high = 0.05 * 30_000.0, 2.0 * 30_000.0
    assert np.all((found.muscles >= low) & (found.muscles <= high))


def test_without_loads_muscles_can_be_set_and_joints_cannot() -> None:
    made = control()
    found = change(made, 5_000.0, distribution=None)
    assert found.joints == {}
    assert found.stable is None
    assert found.missed == ""
    with pytest.raises(AgentError, match="needs the loads of the nominal model"):
        change(made, {"a": 2.0}, distribution=None)


@pytest.mark.parametrize(
    ("value", "limits", "match"),
    [
        (0.0, None, "must be from 1500 to 60000 N/m, one number or 5"),
        (-1.0, None, "must be from 1500 to 60000"),
        (np.nan, None, "must be from 1500 to 60000"),
        (1e6, None, "must be from 1500 to 60000"),
        ("stiff", None, "must be from 1500 to 60000"),
        (np.full(4, 5_000.0), None, "one number or 5"),
        (5_000.0, (6_000.0, 7_000.0), "must be from 6000 to 7000"),
        (5_000.0, (7_000.0, 6_000.0), "limits are"),
        (5_000.0, (0.0, 6_000.0), "limits are"),
        ({"elbow": 1.0}, None, "no joint 'elbow'; joints are a, b, c, d"),
        ({"a": -1.0}, None, "stiffness of joint 'a' is -1.0, but must be positive"),
        ({"a": "soft"}, None, "stiffness of joint 'a' is 'soft'"),
        ({}, None, "no joint was named"),
    ],
)
def test_what_is_not_valid_is_refused_and_nothing_changes(
    value: Any, limits: Any, match: str
) -> None:
    made = control()
    with pytest.raises(AgentError, match=match):
        change(made, value, limits=limits)
    assert made.commanded is None
    assert not made.advance(0.02)


def test_motors_that_are_unknown_are_named() -> None:
    with pytest.raises(AgentError, match="motors' gains are unknown"):
        change(MuscleStiffness(5, 0.03), 5_000.0)
