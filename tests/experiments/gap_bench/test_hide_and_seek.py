"""Effects that `hidden_plants` hides in a machine are found by `reality_gap`.

The two packages share no code. Logs of the whole arm are short, because its 36 tendons have many
candidates. A diagnosis takes up to minutes, so that most cases are slow tests.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import hidden_plants
from experiments.gap_bench.trial import ASSETS
from hidden_plants import Effect, Secret
from hidden_plants.detection_limits import rows
from hidden_plants.mechanisms import mechanism_of
from hidden_plants.sampling import ONLY_ON_ARM
from reality_gap import Diagnosis, Options, Verdict, diagnose, load_study

SECONDS = {"elbow": 12.0, "arm": 5.0}
LARGE = 10.0
"""Amplitude relative to the detection limit of the oracle."""
QUICK = ("viscous_friction",)
"""Effects whose tests are not slow; those in time are in the tests of `reality_gap`."""
ON_ELBOW = [
    pytest.param(id, marks=() if id in QUICK else pytest.mark.slow)
    for id in hidden_plants.CATALOGUE
    if id not in ONLY_ON_ARM
]
ON_ARM = ("force_offset", "tension_scale", "camera_focal")
OUTSIDE = (
    "cogging_torque",
    *(
        pytest.param(id, marks=pytest.mark.slow)
        for id in ("catching_tendon", "tension_crosstalk", "hard_stop")
    ),
)
PAIRS = (
    pytest.param(("force_scale", "attachment_shift"), marks=pytest.mark.slow),
    pytest.param(("length_offset", "tension_scale"), marks=pytest.mark.slow),
    pytest.param(("backlash", "force_offset"), marks=pytest.mark.slow),
)
SEEDS = (1, 2, 3)
"""Seeds of logs without an effect."""


def effect_of(id: str, skip: int = 0, machine: str = "elbow") -> Effect:
    """The effect at one of its locations, at ten times the detection limit or at its largest."""
    locations = [
        r for r in rows(machine) if r.structure.id == id and r.detection_limits[0] < float("inf")
    ]
    row = locations[skip % len(locations)]
    mechanism = mechanism_of(row.structure)
    return mechanism.effect(row.structure, min(LARGE * row.detection_limits[0], mechanism.bound))


def sought(
    folder: Path, secret: Secret, seed: int, machine: str = "elbow", seconds: float = 0.0
) -> Diagnosis:
    """The diagnosis of the secret's log, of `SECONDS` if no duration is given."""
    seconds = seconds or SECONDS[machine]
    hidden_plants.write_study(folder, secret, seed, machine, ASSETS, seconds, baseline=False)
    return diagnose(load_study(folder / "STUDY.yaml"), options=Options(suggest=False))


# The longest come first, so that no process waits for them in the end.
@pytest.mark.slow
@pytest.mark.parametrize("id", ON_ARM)
def test_an_effect_in_the_whole_arm_is_named_with_its_location(tmp_path: Path, id: str) -> None:
    effect = effect_of(id, machine="arm")
    found = sought(tmp_path, Secret((effect,), 0, "single"), 11, "arm")
    assert found.verdict is Verdict.NAMED
    [cause] = found.causes
    assert id in {cause.candidate.cause.id, *cause.equivalent}
    assert set(effect.elements) & set(cause.candidate.location.elements)


@pytest.mark.slow
@pytest.mark.parametrize("id", ON_ELBOW)
def test_what_is_hidden_is_named(tmp_path: Path, id: str) -> None:
    # With seed 7 tolerances outweigh the slack, and the RMS of held-out readings surely grows.
    seed = 8 if id == "slack" else 7
    found = sought(tmp_path, Secret((effect_of(id),), 0, "single"), seed)
    assert found.verdict is Verdict.NAMED
    named = {cause.candidate.cause.id for cause in found.causes}
    assert id in named | {same for cause in found.causes for same in cause.equivalent}


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_where_nothing_is_hidden_nothing_is_found(tmp_path: Path, seed: int) -> None:
    found = sought(tmp_path, Secret((), seed, "null"), seed, seconds=6.0)
    assert found.verdict is Verdict.NOTHING_WRONG
    assert not found.causes


@pytest.mark.slow
@pytest.mark.parametrize("id", OUTSIDE)
def test_what_has_no_name_is_called_unexplained(tmp_path: Path, id: str) -> None:
    found = sought(tmp_path, Secret((effect_of(id),), 0, "outside"), seed=5)
    assert found.verdict is Verdict.UNEXPLAINED
    assert not found.causes
    assert found.fitted_candidates  # something was tried, and is not built in
    assert found.rms_after == found.rms_before
    assert found.extended_xml == load_study(tmp_path / "STUDY.yaml").spec().to_xml()
    assert not found.effects


@pytest.mark.parametrize("pair", PAIRS)
def test_two_causes_are_both_named(tmp_path: Path, pair: tuple[str, str]) -> None:
    effects = (effect_of(pair[0]), effect_of(pair[1], skip=1))
    found = sought(tmp_path, Secret(effects, 0, "pair"), seed=3)
    assert set(pair) <= {cause.candidate.cause.id for cause in found.causes}
