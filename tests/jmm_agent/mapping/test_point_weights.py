"""What displaced points do to lengths, by the hidden units of a map, and the file that keeps it."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jmm_agent.mapping import point_weights as module
from jmm_agent.mapping.group_map import GroupMap
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.point_weights import load_or_compute, point_weights
from jmm_agent.nominal_model import NominalModel, NominalModelError
from tests.jmm_agent.straight_muscles import nominal_model, point_sensitivities, raw_lengths


@pytest.fixture
def nominal() -> NominalModel:
    return nominal_model(points=point_sensitivities)


@pytest.fixture
def jmm(nominal: NominalModel) -> JointMuscleMap:
    """A map with random hidden units; what it maps to does not count here."""
    rng, groups = np.random.default_rng(0), []
    for name, joints, muscles in nominal.topology():
        middle = (nominal.lower + nominal.upper)[joints] / 2.0
        half = (nominal.upper - nominal.lower)[joints] / 2.0
        layers = rng.normal(size=(150, len(joints))), rng.normal(size=150)
        output = rng.normal(size=(len(muscles), 150)), np.zeros(len(muscles))
        groups.append(GroupMap(name, joints, muscles, middle, half, *layers, *output))
    return JointMuscleMap(nominal.joints, nominal.muscles, tuple(groups))


def test_a_change_of_the_output_layer_does_what_displaced_points_do(
    jmm: JointMuscleMap, nominal: NominalModel
) -> None:
    found = point_weights(jmm, nominal)
    assert found is not None
    rng = np.random.default_rng(2)
    q = rng.uniform(nominal.lower, nominal.upper, (200, 6))
    displaced = 0.0001 * rng.normal(size=(8, 9))
    true = raw_lengths(q, displaced) - raw_lengths(q)
    for weights, group in zip(found, jmm.groups, strict=True):
        own = displaced[group.muscle_index]
        change = np.einsum("kh,mhp,mp->km", group.hidden(q), weights, own)
        missed = change - true[:, group.muscle_index]
        missed -= missed.mean(axis=0)  # the offset has a prior of its own
        spread = np.std(true[:, group.muscle_index], axis=0)
        assert (np.sqrt(np.mean(missed**2, axis=0)) < 0.05 * spread).all()


def test_points_that_a_muscle_does_not_have_do_nothing(
    jmm: JointMuscleMap, nominal: NominalModel
) -> None:
    found = point_weights(jmm, nominal)
    assert found is not None
    back = nominal.muscles.index("mid_back")  # the only one with three points
    for weights, group in zip(found, jmm.groups, strict=True):
        for own, muscle in zip(weights, group.muscle_index, strict=True):
            assert bool(np.abs(own[:, 6:]).max() > 1e-6) == (muscle == back)


def test_nothing_is_known_of_a_model_without_points_or_of_another_map(
    jmm: JointMuscleMap, nominal: NominalModel, tmp_path: Path
) -> None:
    assert point_weights(jmm, nominal_model()) is None
    assert load_or_compute(jmm, nominal_model(), tmp_path) is None
    other = replace(jmm, muscles=(*jmm.muscles[:-1], "another"))
    assert load_or_compute(other, nominal, tmp_path) is None
    assert list(tmp_path.iterdir()) == []


def test_a_map_without_some_muscles_knows_the_points_of_the_others(
    jmm: JointMuscleMap, nominal: NominalModel
) -> None:
    whole, fewer = point_weights(jmm, nominal), jmm.without(["mid_back"])
    found = point_weights(fewer, nominal)
    assert whole is not None
    assert found is not None
    for one, other, before, after in zip(whole, found, jmm.groups, fewer.groups, strict=True):
        kept = [jmm.muscles[k] != "mid_back" for k in before.muscle_index]
        assert len(after.muscle_index) == sum(kept)
        np.testing.assert_allclose(other, one[kept], rtol=1e-6, atol=1e-9)


def test_it_is_computed_once_and_read_to_the_bit(
    jmm: JointMuscleMap, nominal: NominalModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = load_or_compute(jmm, nominal, tmp_path / "new")
    monkeypatch.setattr(module, "point_weights", None)  # a second call fails
    again = load_or_compute(jmm, nominal, tmp_path / "new")
    assert found is not None
    assert again is not None
    for one, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("content", ["nothing", "another map", "not finite"])
def test_a_broken_file_is_named_and_written_again(
    content: str,
    jmm: JointMuscleMap,
    nominal: NominalModel,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    found = load_or_compute(jmm, nominal, tmp_path)
    assert found is not None
    [path] = tmp_path.iterdir()
    if content == "nothing":
        path.write_bytes(b"")
    else:
        wrong = [each[:, :5] if content == "another map" else np.nan * each for each in found]
        np.savez(path, **{f"group_{rank}": each for rank, each in enumerate(wrong)})
    with caplog.at_level(logging.WARNING):
        again = load_or_compute(jmm, nominal, tmp_path)
    assert "computed again" in caplog.text
    assert again is not None
    np.testing.assert_array_equal(again[0], found[0])
    caplog.clear()
    load_or_compute(jmm, nominal, tmp_path)
    assert caplog.text == ""


def test_a_folder_that_cannot_be_written_is_named(
    jmm: JointMuscleMap, nominal: NominalModel, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    with caplog.at_level(logging.WARNING):
        assert load_or_compute(jmm, nominal, tmp_path / "file") is not None
    assert "could not be kept" in caplog.text


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        (lambda q: np.zeros((len(q), 8)), r"points of one posture have shape \(1, 8\)"),
        (lambda q: np.zeros((len(q), 7, 3)), r"but \(1, 8, P\) is needed"),
        (lambda q: np.full((len(q), 8, 3), np.nan), "points are not finite"),
    ],
)
def test_points_of_a_model_are_checked(points: object, sentence: str) -> None:
    with pytest.raises(NominalModelError, match=sentence):
        nominal_model(points=points)
