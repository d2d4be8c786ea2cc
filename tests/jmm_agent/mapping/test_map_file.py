"""A map's file: whole or not at all, and refused in one sentence where it is no map."""

import contextlib
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jmm_agent.mapping.joint_muscle_map import CheckpointError, JointMuscleMap
from tests.jmm_agent.small_map import JOINTS, MUSCLES, make_map
from tools.fuzz.mutating import change_member


@pytest.fixture
def jmm():
    return make_map(hidden=7)


def test_saved_and_loaded_is_the_same_to_the_bit(jmm, tmp_path):
    postures = np.random.default_rng(1).normal(size=(6, len(JOINTS)))
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


def rewrite(path, **arrays):
    """A map's file, some arrays replaced."""
    content = dict(np.load(path))
    with path.open("wb") as file:
        np.savez(file, **(content | arrays))


def damage_other_arrays(path):
    with path.open("wb") as file:
        np.savez(file, weights=np.zeros(3))


def damage_other_format(path):
    rewrite(path, format=np.array("jmm-0"))


def damage_nan(path):
    W2 = make_map(hidden=7).groups[1].W2.copy()
    W2[0, 0] = np.nan
    rewrite(path, **{"1_W2": W2})


def damage_scale(path):
    rewrite(path, **{"0_scale": np.array([1.0, 1e-31])})


def damage_shape(path):
    rewrite(path, **{"0_b1": make_map(hidden=7).groups[0].b1[:-1]})


def damage_index(path):
    rewrite(path, **{"0_joint_index": np.array([0, 9])})


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
def test_a_file_that_is_no_map_is_refused_in_one_sentence(jmm, tmp_path, damage):
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


def test_a_map_does_not_unpack_without_limit(jmm, tmp_path, monkeypatch):
    jmm.save(tmp_path / "map.npz")
    JointMuscleMap.load(tmp_path / "map.npz")
    monkeypatch.setattr("jmm_agent.mapping.joint_muscle_map.MAX_BYTES", 1000)
    with pytest.raises(CheckpointError, match="it unfolds into 0 MiB, and 0 are allowed"):
        JointMuscleMap.load(tmp_path / "map.npz")


@settings(max_examples=30)
@given(st.integers(0, 2**32))
def test_any_change_of_a_member_is_read_or_refused(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("changed") / "map.npz"
    make_map().save(path)
    path.write_bytes(change_member(path.read_bytes(), np.random.default_rng(seed)))
    with contextlib.suppress(CheckpointError):
        JointMuscleMap.load(path)


@given(st.data())
def test_any_truncation_is_refused_in_one_sentence(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("cut") / "map.npz"
    make_map().save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    with pytest.raises(CheckpointError):
        JointMuscleMap.load(path)
