"""Lengths by joint angles and tensions: a tendon is a hardening spring in series."""

from __future__ import annotations

import pickle  # noqa: TID251  (copies of maps must work)
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.mapping.array_file import read_arrays, write_arrays
from jmm_agent.mapping.group_map import MappingError
from jmm_agent.mapping.joint_muscle_map import MAX_BYTES, CheckpointError, JointMuscleMap
from jmm_agent.mapping.tendon_stretch import TendonStretch
from tests.jmm_agent.small_map import make_map, postures

TENDONS = TendonStretch(
    np.array([1e-5, 2e-5, 0.0, 1e-4, 5e-6]),
    np.array([4e6, 0.0, 4e6, 1e5, 1e7]),
    np.array([30.0, 30.0, 30.0, 0.0, 10.0]),
)
TENSIONS = np.array([150.0, 60.0, 80.0, 20.0, 300.0])


def elastic() -> JointMuscleMap:
    return replace(make_map(), tendons=TENDONS)


def test_the_stretch_solves_the_law_of_a_tendon() -> None:
    total = TENDONS.stretch(TENSIONS) - TENDONS.stretch(np.zeros(5))
    firm = TENDONS.compliance > 0.0
    x, c, h = total[firm], TENDONS.compliance[firm], TENDONS.hardening[firm]
    np.testing.assert_allclose(x / c + h * x**2, TENSIONS[firm], rtol=1e-10)
    assert total[~firm] == 0.0
    np.testing.assert_allclose(TENDONS.stretch(TENDONS.reference), 0.0, atol=1e-18)
    np.testing.assert_array_equal(TENDONS.stretch(-TENSIONS), TENDONS.stretch(np.zeros(5)))


def test_a_length_is_that_of_the_networks_minus_the_stretch() -> None:
    jmm, q = elastic(), postures(3)
    np.testing.assert_array_equal(jmm.lengths(q), make_map().lengths(q))
    many = np.array([TENSIONS, 2.0 * TENSIONS, TENDONS.reference])
    expected = jmm.lengths(q) - TENDONS.stretch(many)
    np.testing.assert_array_equal(jmm.lengths(q, many), expected)
    one = jmm.lengths(q[0], TENSIONS)
    np.testing.assert_allclose(one, expected[0], rtol=1e-12)
    np.testing.assert_allclose(jmm.lengths(q[2], TENDONS.reference), jmm.lengths(q[2]), atol=1e-18)


def test_jacobians_are_the_slopes_by_angles_and_by_tensions() -> None:
    jmm, q, small = elastic(), postures(1)[0], 1e-3
    slopes = [
        (jmm.lengths(q, TENSIONS + move) - jmm.lengths(q, TENSIONS - move)) / (2.0 * small)
        for move in small * np.eye(5)
    ]
    np.testing.assert_allclose(np.diag(jmm.tension_jacobian(TENSIONS)), slopes, atol=1e-11)
    np.testing.assert_array_equal(jmm.jacobian(q), make_map().jacobian(q))


def test_without_tendons_tensions_have_no_effect_to_the_bit() -> None:
    jmm, q = make_map(), postures(2)
    assert jmm.tendons is None
    np.testing.assert_array_equal(jmm.lengths(q, np.tile(TENSIONS, (2, 1))), jmm.lengths(q))
    np.testing.assert_array_equal(jmm.tension_jacobian(TENSIONS), np.zeros(5))


def test_tendons_stay_through_files_copies_and_learning(tmp_path: Path) -> None:
    jmm, q = elastic(), postures(1)[0]
    jmm.save(tmp_path / "elastic.npz")
    layers = {"near": (jmm.groups[0].W2, jmm.groups[0].b2)}
    for other in (
        JointMuscleMap.load(tmp_path / "elastic.npz"),
        deepcopy(jmm),
        pickle.loads(pickle.dumps(jmm)),
        jmm.with_output_layers(layers),
    ):
        np.testing.assert_array_equal(other.lengths(q, TENSIONS), jmm.lengths(q, TENSIONS))
    make_map().save(tmp_path / "stiff.npz")
    assert str(read_arrays(tmp_path / "stiff.npz", MAX_BYTES)["format"]) == "jmm-1"
    assert JointMuscleMap.load(tmp_path / "stiff.npz").tendons is None


def test_a_file_without_its_tendons_is_refused(tmp_path: Path) -> None:
    elastic().save(tmp_path / "elastic.npz")
    content = dict(read_arrays(tmp_path / "elastic.npz", MAX_BYTES))
    del content["tendons_hardening"]
    write_arrays(tmp_path / "cut.npz", content)
    with pytest.raises(CheckpointError, match="not a joint-muscle map"):
        JointMuscleMap.load(tmp_path / "cut.npz")


def test_what_does_not_fit_is_refused() -> None:
    three = np.zeros(3)
    with pytest.raises(MappingError, match="tendons of 3 muscles, but 5 muscles"):
        replace(make_map(), tendons=TendonStretch(three, three, three))
    for bad in (np.array([-1.0, 0.0, 0.0]), np.array([np.nan, 0.0, 0.0]), np.zeros(2), 1.0):
        with pytest.raises(AgentError, match="TendonStretch: hardening must be finite numbers"):
            TendonStretch(three, bad, three)  # type: ignore[arg-type]
    with pytest.raises(MappingError, match=r"tensions have shape \(4,\), but \(5,\)"):
        elastic().lengths(postures(1)[0], np.zeros(4))
    with pytest.raises(MappingError, match="tensions are not finite"):
        elastic().lengths(postures(1)[0], np.full(5, np.nan))
