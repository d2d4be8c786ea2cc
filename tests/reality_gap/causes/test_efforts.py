"""Measured efforts with a wrong scale, an offset or a delay."""

from __future__ import annotations

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Location
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import measured
from reality_gap.study.system import System
from tests.reality_gap.causes.candidates import candidate, with_cause
from tests.reality_gap.causes.carriage import carriage_study
from tests.reality_gap.causes.machines import predict


def test_measured_efforts_may_have_a_scale_and_an_offset(systems: dict[str, System]) -> None:
    system = systems["arm"]
    at = Location("sensor", ("force_elbow",))
    readings = measured(system.study)
    own, before = readings.channel == 4, predict(system)

    scaled = with_cause(system, "effort_scale", at, scale=0.5)
    shifted = with_cause(system, "effort_offset", at, offset=0.3)

    np.testing.assert_allclose(scaled, np.where(own, 1.5 * before, before), atol=1e-9)
    np.testing.assert_allclose(shifted, before + np.where(own, 0.3 / readings.noise, 0), atol=1e-9)


@pytest.mark.parametrize("late", [0.03, -0.03])
def test_efforts_may_be_later_than_positions_or_earlier(
    systems: dict[str, System], late: float
) -> None:
    with Replayer(carriage_study(systems["screw"].study.model, late)) as replayer:
        [location] = CATALOGUE["delay"].locations(replayer.system)
        one = candidate(replayer.system, "delay", location)
        before, after = replayer.residuals([[], [(one, {"delay": late})]])

    assert np.sqrt(np.mean(after**2)) < 0.05 * np.sqrt(np.mean(before**2))


def test_a_scale_of_efforts_scales_what_inverse_dynamics_compute(
    systems: dict[str, System],
) -> None:
    one = candidate(systems["effort"], "effort_scale", Location("joint", ("screw",)))
    with Replayer(carriage_study(systems["screw"].study.model)) as replayer:
        plain, scaled = (
            replayer.replay(parts).prediction for parts in ([], [(one, {"scale": 0.5})])
        )

    np.testing.assert_allclose(scaled, 1.5 * plain)
