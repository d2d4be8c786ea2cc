"""The mapping: values and Jacobians against closed forms and finite differences, and its file."""

import contextlib
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jmm_agent.mapping import (
    LARGEST,
    CheckpointError,
    JointMuscleMap,
    MappingError,
)
from tests.jmm_agent.small_map import JOINTS, MUSCLES, make_map
from tools.fuzz.mutating import some_member


@pytest.fixture
def jmm():
    return make_map(hidden=7)


@pytest.fixture
def postures():
    return np.random.default_rng(1).normal(size=(6, len(JOINTS)))


def written_out(jmm, q):
    """The paper's network, muscle by muscle, from the fields alone."""
    lengths = np.full(len(MUSCLES), np.nan)
    for group in jmm.groups:
        x = (q[group.joint_index] - group.centre) / group.scale
        hidden = [1 / (1 + np.exp(-(w @ x + b))) for w, b in zip(group.W1, group.b1, strict=True)]
        for muscle, w, b in zip(group.muscle_index, group.W2, group.b2, strict=True):
            lengths[muscle] = 0.001 * (w @ hidden + b)
    return lengths


def differences(f, q, step=1e-5):
    """Central differences of f (n,) -> (m,) as columns (m, n)."""
    return np.stack(
        [(f(q + step * e) - f(q - step * e)) / (2 * step) for e in np.eye(len(q))], axis=1
    )


def test_lengths_are_the_network_in_metres(jmm, postures):
    expected = np.array([written_out(jmm, q) for q in postures])
    np.testing.assert_allclose(jmm.lengths(postures), expected, atol=1e-14)
    np.testing.assert_allclose(jmm.lengths(postures[0]), expected[0], atol=1e-14)


def test_analytic_jacobian_is_the_derivative_of_lengths(jmm, postures):
    expected = np.array([differences(jmm.lengths, q) for q in postures])
    np.testing.assert_allclose(jmm.jacobian(postures), expected, atol=1e-10)
    np.testing.assert_allclose(jmm.jacobian(postures[0]), expected[0], atol=1e-10)


def test_lengths_and_jacobian_are_those_of_the_two_alone(jmm, postures):
    lengths, jacobian = jmm.lengths_and_jacobian(postures)
    np.testing.assert_array_equal(lengths, jmm.lengths(postures))
    np.testing.assert_array_equal(jacobian, jmm.jacobian(postures))


def test_jacobian_is_zero_where_no_group_input_is(jmm, postures):
    jacobian = jmm.jacobian(postures)
    assert not jacobian[:, [0, 3]][..., [2, 3]].any()
    assert not jacobian[:, [1, 4, 2]][..., 0].any()


def test_quadratic_jacobian_is_the_papers_normal_equations(jmm, postures):
    step = 0.17
    q = postures[0]
    expected = np.empty((len(MUSCLES), len(JOINTS)))
    for j in range(len(JOINTS)):
        x = q[j] + step * np.arange(-2, 3)
        y = np.array([jmm.lengths(np.where(np.arange(len(q)) == j, at, q)) for at in x])
        a, b, _ = np.polyfit(x, y, 2)
        expected[:, j] = 2 * a * q[j] + b
    np.testing.assert_allclose(jmm.jacobian_quadratic(q, step), expected, atol=1e-10)
    np.testing.assert_allclose(jmm.jacobian_quadratic(postures, step)[0], expected, atol=1e-10)


def test_quadratic_jacobian_tends_to_the_analytic_one(jmm, postures):
    np.testing.assert_allclose(
        jmm.jacobian_quadratic(postures, 1e-4), jmm.jacobian(postures), atol=1e-8
    )


def test_quadratic_jacobian_steps_ten_degrees(jmm, postures):
    np.testing.assert_array_equal(
        jmm.jacobian_quadratic(postures), jmm.jacobian_quadratic(postures, np.deg2rad(10.0))
    )


@given(st.lists(st.floats(-1e6, 1e6), min_size=4, max_size=4))
def test_far_postures_give_finite_numbers(q):
    lengths, jacobian = make_map().lengths_and_jacobian(np.array(q))
    assert np.isfinite(lengths).all()
    assert np.isfinite(jacobian).all()


def test_output_layers_are_replaced_in_a_new_map(jmm, postures):
    before = jmm.lengths(postures)
    far = jmm.groups[1]
    moved = jmm.with_output_layers({"far": (far.W2, far.b2 + 3.0)})
    np.testing.assert_array_equal(jmm.lengths(postures), before)
    change = moved.lengths(postures) - before
    np.testing.assert_allclose(change[:, [1, 4, 2]], 0.003, atol=1e-12)
    np.testing.assert_array_equal(change[:, [0, 3]], 0.0)


def test_a_map_shares_no_memory_with_what_it_was_made_of(jmm, postures):
    W2, b2 = jmm.groups[0].W2.copy(), jmm.groups[0].b2.copy()
    moved = jmm.with_output_layers({"near": (W2, b2)})
    before = moved.lengths(postures)
    W2 += 1.0
    np.testing.assert_array_equal(moved.lengths(postures), before)
    with pytest.raises(ValueError, match="read-only"):
        moved.groups[0].W2[0, 0] = 0.0


@pytest.mark.parametrize(
    ("layers", "sentence"),
    [
        ({"hip": None}, "unknown group 'hip'; groups are \\['near', 'far'\\]"),
        ({"near": (np.zeros((2, 6)), np.zeros(2))}, "W2 has shape \\(2, 6\\), but \\(2, 7\\) fits"),
        ({"near": (np.full((2, 7), np.nan), np.zeros(2))}, "W2 has a number that is not finite"),
        ({"near": (np.full((2, 7), -1e31), np.zeros(2))}, "W2 has .* beyond 1e\\+30"),
    ],
)
def test_output_layers_that_do_not_fit_are_refused(jmm, layers, sentence):
    with pytest.raises(MappingError, match=sentence):
        jmm.with_output_layers(layers)


@pytest.mark.parametrize(
    ("q", "sentence"),
    [
        (np.zeros(3), "shape \\(3,\\)"),
        (np.zeros((2, 5)), "shape \\(2, 5\\)"),
        (np.zeros((1, 2, 4)), "shape \\(1, 2, 4\\)"),
        (0.0, "shape \\(\\)"),
        (np.array([0, 0, np.nan, 0]), "not finite"),
    ],
)
def test_postures_that_do_not_fit_are_refused(jmm, q, sentence):
    for method in (jmm.lengths, jmm.jacobian, jmm.jacobian_quadratic):
        with pytest.raises(MappingError, match=sentence):
            method(q)


@pytest.mark.parametrize("step", [0.0, -0.1, np.nan, np.inf])
def test_a_step_that_is_not_positive_is_refused(jmm, step):
    with pytest.raises(MappingError, match="must be positive"):
        jmm.jacobian_quadratic(np.zeros(4), step)


def test_each_muscle_needs_exactly_one_group(jmm):
    with pytest.raises(MappingError, match="exactly one group"):
        JointMuscleMap(JOINTS, MUSCLES, jmm.groups[:1])


def test_saved_and_loaded_is_the_same_to_the_bit(jmm, postures, tmp_path):
    path = tmp_path / "map.npz"
    jmm.save(path)
    loaded = JointMuscleMap.load(path)
    assert (loaded.joints, loaded.muscles) == (JOINTS, MUSCLES)
    assert [group.name for group in loaded.groups] == ["near", "far"]
    np.testing.assert_array_equal(loaded.lengths(postures), jmm.lengths(postures))
    np.testing.assert_array_equal(loaded.jacobian(postures), jmm.jacobian(postures))
    assert [file.name for file in tmp_path.iterdir()] == ["map.npz"]


def broken(*arguments, **_):
    if hasattr(arguments[0], "write"):
        arguments[0].write(b"half")
    raise OSError("disk full")


@pytest.mark.parametrize("step", ["numpy.savez", "os.replace"])
def test_a_save_that_fails_leaves_the_old_file(jmm, tmp_path, monkeypatch, step):
    path = tmp_path / "map.npz"
    jmm.save(path)
    before = path.read_bytes()
    monkeypatch.setattr(step, broken)
    with pytest.raises(OSError, match="disk full"):
        make_map(seed=5).save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["map.npz"]


def damage_empty(path):
    path.write_bytes(b"")


def damage_text(path):
    path.write_text("not a map")


def damage_truncated(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def damage_flipped(path):
    content = bytearray(path.read_bytes())
    content[content.index(make_map(hidden=7).groups[1].W1.tobytes()) + 20] ^= 0x01
    path.write_bytes(bytes(content))


def damage_other_arrays(path):
    with path.open("wb") as file:
        np.savez(file, weights=np.zeros(3))


def damage_other_format(path):
    content = dict(np.load(path))
    with path.open("wb") as file:
        np.savez(file, **(content | {"format": np.array("jmm-0")}))


def damage_nan(path):
    content = dict(np.load(path))
    content["1_W2"][0, 0] = np.nan
    with path.open("wb") as file:
        np.savez(file, **content)


def damage_scale(path):
    content = dict(np.load(path))
    content["0_scale"][1] = 1e-31
    with path.open("wb") as file:
        np.savez(file, **content)


def damage_shape(path):
    content = dict(np.load(path))
    content["0_b1"] = content["0_b1"][:-1]
    with path.open("wb") as file:
        np.savez(file, **content)


def damage_index(path):
    content = dict(np.load(path))
    content["0_joint_index"] = np.array([0, 9])
    with path.open("wb") as file:
        np.savez(file, **content)


def damage_single_array(path):
    with path.open("wb") as file:
        np.save(file, np.zeros(3))


def damage_directory(path):
    path.unlink()
    path.mkdir()


def replace_member(path, content):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("format.npy", content)


def damage_header_without_end(path):
    replace_member(path, b"\x93NUMPY\x01\x00\x10\x00{'descr': (      \n")


def damage_endless_words(path):
    replace_member(path, b"\x93NUMPY\x02\x00\x00\x80\x00\x00" + b"x" * 0x8000)


def damage_missing(path):
    path.unlink()


@pytest.mark.parametrize(
    "damage", [f for name, f in sorted(globals().items()) if name.startswith("damage_")]
)
def test_a_file_that_is_no_map_gives_one_sentence(jmm, tmp_path, damage):
    path = tmp_path / "map.npz"
    jmm.save(path)
    damage(path)
    with pytest.raises(CheckpointError, match=r"Checkpoint .*map\.npz: ") as caught:
        JointMuscleMap.load(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_name_that_is_too_long_is_of_no_file(tmp_path):
    with pytest.raises(CheckpointError, match="there is no such file"):
        JointMuscleMap.load(tmp_path / ("x" * 5000))


def test_the_largest_numbers_of_a_map_overflow_nowhere(jmm, postures):
    extreme = {"centre": -LARGEST, "scale": 1.0 / LARGEST, "W1": LARGEST, "W2": LARGEST}
    groups = tuple(
        replace(g, **{name: np.full_like(getattr(g, name), x) for name, x in extreme.items()})
        for g in jmm.groups
    )
    for array in replace(jmm, groups=groups).lengths_and_jacobian(postures):
        assert np.isfinite(array).all()


def test_a_map_does_not_unfold_into_everything(jmm, tmp_path, monkeypatch):
    jmm.save(tmp_path / "map.npz")
    JointMuscleMap.load(tmp_path / "map.npz")
    monkeypatch.setattr("jmm_agent.mapping.MAX_BYTES", 1000)
    with pytest.raises(CheckpointError, match="it unfolds into 0 MiB, and a map has 0"):
        JointMuscleMap.load(tmp_path / "map.npz")


@settings(max_examples=30)
@given(st.integers(0, 2**32))
def test_any_change_of_a_member_is_read_or_refused(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("changed") / "map.npz"
    make_map().save(path)
    path.write_bytes(some_member(path.read_bytes(), np.random.default_rng(seed)))
    with contextlib.suppress(CheckpointError):
        JointMuscleMap.load(path)


@given(st.data())
def test_any_truncation_gives_one_sentence(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("cut") / "map.npz"
    make_map().save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    with pytest.raises(CheckpointError):
        JointMuscleMap.load(path)
