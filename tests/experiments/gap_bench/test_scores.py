"""The bench of the diagnosis: what counts as right in one trial."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.gap_bench.scores import (
    added_mass_error,
    entropy,
    exact_set,
    gain_ratio,
    link_mass,
    parameter_error,
    right_first,
    right_location,
    right_or_equivalent,
    said,
)
from tests.experiments.gap_bench.trials import FRICTION, Named, made


def test_the_first_name_counts() -> None:
    assert right_first(made(named=(FRICTION,)))
    other = ("viscous_friction", ["biceps"], {"damping": 5.0})
    assert not right_first(made(named=(other, FRICTION)))
    assert said(made()) == "nothing"
    assert said(made(verdict="unexplained")) == "unexplained"


def test_a_declared_equivalent_is_counted_apart() -> None:
    other: Named = ("viscous_friction", ["biceps"], {"damping": 5.0})
    trial = made(named=(other,), equivalent=["coulomb_friction"])
    assert not right_first(trial)
    assert right_or_equivalent(trial)
    assert not right_or_equivalent(made(named=(other,)))


@pytest.mark.parametrize(
    ("cause", "hidden", "named", "right"),
    [
        ("attachment_shift", ["biceps_0"], ["biceps_2"], True),
        ("attachment_shift", ["biceps_0"], ["triceps_0"], False),
        ("tension_scale", ["biceps"], ["tension_biceps"], True),
        ("coulomb_friction", ["biceps"], ["biceps", "brachialis", "triceps"], False),
        ("payload", ["hand"], ["radius"], True),
        ("delay", ["tension_biceps"], ["biceps"], False),
        ("delay", ["biceps"], ["biceps"], True),
        ("gravity_direction", [], ["gravity"], None),
    ],
)
def test_a_place_is_right_if_it_is_the_same_muscle_joint_link_or_sensor(
    cause: str, hidden: list[str], named: list[str], right: bool | None
) -> None:
    trial = made(hidden=((cause, hidden, {}),), named=((cause, named, {}),))
    assert right_location(trial) is right


def test_a_place_elsewhere_counts_only_where_it_is_asked_for() -> None:
    wrong = ("coulomb_friction", ["triceps"], {"friction": 5.0})
    trial = made(named=(wrong,), elsewhere=[["biceps"]])
    assert right_location(trial) is False
    assert right_location(trial, elsewhere=True) is True


def test_of_two_causes_both_must_be_named_and_no_third() -> None:
    delay: Named = ("delay", ["biceps"], {"delay": 0.01})
    pair = (("coulomb_friction", ["biceps"], {}), ("delay", ["biceps"], {}))
    assert exact_set(made("pair", pair, (delay, FRICTION)))
    assert not exact_set(made("pair", pair, (FRICTION,)))
    assert not exact_set(made("pair", pair, (FRICTION, FRICTION)))
    lag: Named = ("actuator_lag", ["biceps"], {})
    assert not exact_set(made("pair", pair, (FRICTION, delay, lag)))
    almost = made("pair", pair, (lag, FRICTION), equivalent=["delay"])
    assert not exact_set(almost)
    assert exact_set(almost, equivalents=True)


def test_errors_are_in_the_unit_of_their_family() -> None:
    assert parameter_error(made(named=(FRICTION,))) == ("friction", pytest.approx(25.0))
    late = (("delay", ["biceps"], {"delay": 0.01}),)
    found = parameter_error(made(hidden=late, named=(("delay", ["biceps"], {"delay": 0.03}),)))
    assert found == ("delay", pytest.approx(1.0))
    soft = (("tendon_elasticity", ["biceps"], {"compliance": 2e-6, "stiffness": 5e5}),)
    told: Named = ("tendon_elasticity", ["biceps"], {"compliance": 1e-6})
    assert parameter_error(made(hidden=soft, named=(told,))) == ("stiffness", pytest.approx(100.0))
    uneven = (("direction_dependent_friction", ["biceps"], {"force_out": 8.0, "force_in": 2.0}),)
    told = ("direction_dependent_friction", ["biceps"], {"forward": 9.0, "backward": 1.0})
    assert parameter_error(made(hidden=uneven, named=(told,))) == ("friction", pytest.approx(20.0))


def test_friction_around_bends_is_compared_as_a_share_of_the_tension() -> None:
    hidden = (("load_dependent_friction", ["biceps"], {"share": 0.02}),)
    named = (("load_dependent_friction", ["biceps"], {"coefficient": 0.055}),)
    assert parameter_error(made(hidden=hidden, named=named)) == ("friction", pytest.approx(175.0))
    found = parameter_error(made(hidden=hidden, named=named, bend=0.4))
    assert found == ("friction", pytest.approx(10.0))


def test_a_mass_is_compared_with_the_whole_link() -> None:
    heavy = (("link_mass", ["ulna"], {"mass": 0.1}),)
    trial = made(hidden=heavy, named=(("link_mass", ["ulna"], {"mass": 0.11}),))
    found = parameter_error(trial)
    assert found == ("mass", pytest.approx(1.0 / (link_mass(trial) + 0.1)))
    assert added_mass_error(trial) == pytest.approx(10.0)


def test_numbers_of_wrong_names_and_places_are_not_compared() -> None:
    other: Named = ("viscous_friction", ["biceps"], {"damping": 5.0})
    assert parameter_error(made(named=(other,))) is None
    elsewhere: Named = ("coulomb_friction", ["triceps"], {"friction": 5.0})
    assert parameter_error(made(named=(elsewhere,))) is None


def test_entropy_is_that_of_the_least_certain_place() -> None:
    sure = [[0, "delay", ["biceps"], 1.0, 1.0]]
    torn = [[1, "delay", ["biceps"], 1.0, 0.5], [1, "actuator_lag", ["biceps"], 1.0, 0.5]]
    assert entropy(made(candidates=sure)) == pytest.approx(0.0)
    assert entropy(made(candidates=sure + torn)) == pytest.approx(np.log(2))
    assert entropy(made()) is None


def test_gains_are_over_that_of_the_true_model() -> None:
    assert gain_ratio(made(gain=0.4, true_model={"rms": 1.0, "gain": 0.8})) == pytest.approx(0.5)
    assert gain_ratio(made(gain=None, true_model={"rms": 1.0, "gain": 0.8})) is None
    assert gain_ratio(made(gain=0.4, true_model={"rms": 1.0, "gain": None})) is None
    assert gain_ratio(made(gain=0.4, true_model={"rms": 1.0, "gain": 0.01})) is None
