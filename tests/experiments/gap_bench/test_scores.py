"""Scores of a diagnosis trial: which answers are right."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.gap_bench.scores import (
    added_mass_error,
    entropy,
    exact_set,
    first_name,
    gain_ratio,
    link_mass,
    parameter_error,
    right_first,
    right_location,
    right_or_equivalent,
)
from tests.experiments.gap_bench.trials import FRICTION, Named, make_trial


def test_the_first_name_counts() -> None:
    assert right_first(make_trial(named=(FRICTION,)))
    other = ("viscous_friction", ["biceps"], {"damping": 5.0})
    assert not right_first(make_trial(named=(other, FRICTION)))
    assert first_name(make_trial()) == "nothing"
    assert first_name(make_trial(verdict="unexplained")) == "unexplained"


def test_names_of_a_part_count_as_names() -> None:
    partly = make_trial(named=(FRICTION,), verdict="partly_named")
    assert right_first(partly)
    assert exact_set(partly)
    assert first_name(partly) == "coulomb_friction"


def test_a_declared_equivalent_is_counted_apart() -> None:
    other: Named = ("viscous_friction", ["biceps"], {"damping": 5.0})
    trial = make_trial(named=(other,), equivalent=["coulomb_friction"])
    assert not right_first(trial)
    assert right_or_equivalent(trial)
    assert not right_or_equivalent(make_trial(named=(other,)))


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
def test_a_location_is_right_if_it_is_the_same_muscle_joint_link_or_sensor(
    cause: str, hidden: list[str], named: list[str], right: bool | None
) -> None:
    trial = make_trial(hidden=((cause, hidden, {}),), named=((cause, named, {}),))
    assert right_location(trial) is right


def test_a_location_elsewhere_counts_only_on_request() -> None:
    wrong = ("coulomb_friction", ["triceps"], {"friction": 5.0})
    trial = make_trial(named=(wrong,), elsewhere=[["biceps"]])
    assert right_location(trial) is False
    assert right_location(trial, elsewhere=True) is True


def test_of_two_causes_both_must_be_named_and_no_third() -> None:
    delay: Named = ("delay", ["biceps"], {"delay": 0.01})
    pair = (("coulomb_friction", ["biceps"], {}), ("delay", ["biceps"], {}))
    assert exact_set(make_trial("pair", pair, (delay, FRICTION)))
    assert not exact_set(make_trial("pair", pair, (FRICTION,)))
    assert not exact_set(make_trial("pair", pair, (FRICTION, FRICTION)))
    lag: Named = ("actuator_lag", ["biceps"], {})
    assert not exact_set(make_trial("pair", pair, (FRICTION, delay, lag)))
    almost = make_trial("pair", pair, (lag, FRICTION), equivalent=["delay"])
    assert not exact_set(almost)
    assert exact_set(almost, equivalents=True)


def test_errors_are_in_the_unit_of_their_family() -> None:
    assert parameter_error(make_trial(named=(FRICTION,))) == ("friction", pytest.approx(25.0))
    late = (("delay", ["biceps"], {"delay": 0.01}),)
    found = parameter_error(
        make_trial(hidden=late, named=(("delay", ["biceps"], {"delay": 0.03}),))
    )
    assert found == ("delay", pytest.approx(1.0))
    soft = (("tendon_elasticity", ["biceps"], {"compliance": 2e-6, "stiffness": 5e5}),)
    answer: Named = ("tendon_elasticity", ["biceps"], {"compliance": 1e-6})
    assert parameter_error(make_trial(hidden=soft, named=(answer,))) == (
        "stiffness",
        pytest.approx(100.0),
    )
    uneven = (("direction_dependent_friction", ["biceps"], {"force_out": 8.0, "force_in": 2.0}),)
    answer = ("direction_dependent_friction", ["biceps"], {"forward": 9.0, "backward": 1.0})
    assert parameter_error(make_trial(hidden=uneven, named=(answer,))) == (
        "friction",
        pytest.approx(20.0),
    )


def test_friction_around_bends_is_compared_as_a_share_of_the_tension() -> None:
    hidden = (("load_dependent_friction", ["biceps"], {"share": 0.02}),)
    named = (("load_dependent_friction", ["biceps"], {"coefficient": 0.055}),)
    assert parameter_error(make_trial(hidden=hidden, named=named)) == (
        "friction",
        pytest.approx(175.0),
    )
    found = parameter_error(make_trial(hidden=hidden, named=named, bend=0.4))
    assert found == ("friction", pytest.approx(10.0))


def test_a_mass_is_compared_with_the_whole_link() -> None:
    heavy = (("link_mass", ["ulna"], {"mass": 0.1}),)
    trial = make_trial(hidden=heavy, named=(("link_mass", ["ulna"], {"mass": 0.11}),))
    found = parameter_error(trial)
    assert found == ("mass", pytest.approx(1.0 / (link_mass(trial) + 0.1)))
    assert added_mass_error(trial) == pytest.approx(10.0)


def test_parameters_of_wrong_names_and_locations_are_not_compared() -> None:
    other: Named = ("viscous_friction", ["biceps"], {"damping": 5.0})
    assert parameter_error(make_trial(named=(other,))) is None
    elsewhere: Named = ("coulomb_friction", ["triceps"], {"friction": 5.0})
    assert parameter_error(make_trial(named=(elsewhere,))) is None


def test_entropy_is_that_of_the_least_certain_step() -> None:
    sure = [[0, "delay", ["biceps"], 1.0, 1.0]]
    torn = [[1, "delay", ["biceps"], 1.0, 0.5], [1, "actuator_lag", ["biceps"], 1.0, 0.5]]
    assert entropy(make_trial(candidates=sure)) == pytest.approx(0.0)
    assert entropy(make_trial(candidates=sure + torn)) == pytest.approx(np.log(2))
    assert entropy(make_trial()) is None


def test_gains_are_over_that_of_the_true_model() -> None:
    assert gain_ratio(make_trial(gain=0.4, true_model={"rms": 1.0, "gain": 0.8})) == pytest.approx(
        0.5
    )
    assert gain_ratio(make_trial(gain=None, true_model={"rms": 1.0, "gain": 0.8})) is None
    assert gain_ratio(make_trial(gain=0.4, true_model={"rms": 1.0, "gain": None})) is None
    assert gain_ratio(make_trial(gain=0.4, true_model={"rms": 1.0, "gain": 0.01})) is None
