"""Training from a nominal model: accuracy, the cache, and bad input."""

import logging
import os
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.recipe import Recipe, TrainingError
from jmm_agent.mapping.torch_process import TorchProcess
from jmm_agent.mapping.training import content_hash, load_or_train, train
from jmm_agent.nominal_model import NominalModelError
from tests.jmm_agent.straight_muscles import (
    GROUPS,
    JOINTS,
    crosses,
    nominal_model,
    relative_lengths,
)

QUICK = Recipe(hidden=60, samples=2000, steps=20)


@pytest.fixture(scope="module", autouse=True)
def one_process():
    """Trains all maps in one process: to start one with torch takes longer than the training."""
    with TorchProcess() as process, pytest.MonkeyPatch.context() as patch:
        patch.setattr("jmm_agent.mapping.training.TorchProcess", lambda: nullcontext(process))
        yield


def postures_inside(of, count, seed=7):
    return np.random.default_rng(seed).uniform(of.lower, of.upper, (count, len(of.joints)))


def rms(array):
    return float(np.sqrt(np.square(array).mean()))


# The nominal model


def test_a_group_has_all_joints_that_its_muscles_cross():
    base, mid, tip = nominal_model().topology()
    assert (base.name, mid.name, tip.name) == tuple(GROUPS)
    # mid_long starts at the ground: it belongs to the middle and brings the base's joints.
    np.testing.assert_array_equal(base.muscle_index, [0, 1, 2])
    np.testing.assert_array_equal(base.joint_index, [0, 1])
    np.testing.assert_array_equal(mid.muscle_index, [3, 4, 5])
    np.testing.assert_array_equal(mid.joint_index, [0, 1, 2, 3])
    np.testing.assert_array_equal(tip.muscle_index, [6, 7])
    np.testing.assert_array_equal(tip.joint_index, [4, 5])


def without_middle_joint(q):
    return relative_lengths(q)[:, :-1]


def not_relative(q):
    return relative_lengths(q) + 0.1


def not_finite(q):
    return relative_lengths(q) * np.nan


CROSSES_TOO_FEW = crosses() & ~np.eye(8, 6, dtype=bool)
CROSSES_NOTHING = crosses() & (np.arange(8) != 2)[:, None]
TWICE = {"base": JOINTS[:3], "mid": JOINTS[2:4], "tip": JOINTS[4:]}
UNKNOWN = GROUPS | {"tip": ("tip_pitch", "tip_yaw", "tail")}
ALONE = {"base": JOINTS[:2], "mid": JOINTS[2:4], "tip": JOINTS[4:], "none": ()}


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"joints": ("a",) * 6}, "joints must be at least one and all different"),
        ({"lower": np.zeros(5)}, r"lower has shape \(5,\), but \(6,\) fits"),
        ({"lower": np.full(6, 2.0)}, "joint 'base_yaw' has limits"),
        ({"upper": np.full(6, np.inf)}, "must be finite"),
        ({"crosses": crosses().T}, r"crosses has shape \(6, 8\), but \(8, 6\) fits"),
        ({"crosses": CROSSES_TOO_FEW}, "muscle 'base_front' changes with joint 'base_yaw'"),
        ({"crosses": CROSSES_NOTHING}, "muscle 'base_right' crosses no joint"),
        ({"groups": TWICE}, "joint 'mid_roll' is owned by 2 groups"),
        ({"groups": UNKNOWN}, "unknown joint 'tail'; joints are"),
        ({"groups": ALONE}, "group 'none' has no muscle"),
        ({"lengths": without_middle_joint}, r"shape \(8, 7\), but \(8, 8\) is needed"),
        ({"lengths": not_relative}, "must be relative to q = 0"),
        ({"lengths": not_finite}, "not finite"),
    ],
)
def test_a_nominal_model_that_contradicts_itself_is_refused(changes, sentence):
    with pytest.raises(NominalModelError, match=sentence):
        nominal_model(**changes)


def test_a_joint_without_muscle_is_refused():
    with pytest.raises(NominalModelError, match="joint 'tip_yaw' is crossed by no muscle"):
        nominal_model(crosses=crosses() & (np.arange(6) != 5))


# Recipes


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"hidden": 0}, "hidden is 0, but must be positive"),
        ({"rate": np.nan}, "rate is nan"),
        ({"margin": -0.1}, "margin is -0.1"),
        ({"samples": 10}, "10 samples are less than one batch of 64"),
    ],
)
def test_a_recipe_that_cannot_be_followed_is_refused(wrong, sentence):
    with pytest.raises(TrainingError, match=sentence):
        Recipe(**wrong)


def test_training_that_diverges_is_refused():
    with pytest.raises(TrainingError, match="diverged at rate 1e\\+30"):
        train(nominal_model(), 0, replace(QUICK, rate=1e30))


# Training


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """The file of a trained map in its cache."""
    folder = tmp_path_factory.mktemp("kept")
    load_or_train(nominal_model(), 0, folder, QUICK)
    (path,) = folder.iterdir()
    return path


def test_the_chain_is_learnt_to_a_tenth_of_a_millimetre():
    chain = nominal_model()
    jmm, report = train(chain, 0, Recipe(hidden=300, samples=10_000))
    q = postures_inside(chain, 2000)
    error = jmm.lengths(q) - relative_lengths(q)
    assert rms(relative_lengths(q)) > 0.01
    for group in jmm.groups:
        measured = rms(error[:, group.muscle_index])
        assert measured < 1e-4
        assert report.groups[group.name].validation_rmse == pytest.approx(measured, rel=0.15)
        history = report.groups[group.name].history
        assert history[-1] < 0.1 * history[0]


@pytest.mark.parametrize("threads", [pytest.param("1", marks=pytest.mark.slow), "3"])
def test_the_same_seed_trains_the_same_bits_in_another_process(tmp_path, kept, threads):
    program = (
        "import sys; from tests.jmm_agent.straight_muscles import nominal_model;"
        "from jmm_agent.mapping.recipe import Recipe;"
        "from jmm_agent.mapping.training import train;"
        "train(nominal_model(), 0, Recipe(hidden=60, samples=2000, steps=20))[0].save(sys.argv[1])"
    )
    root = Path(__file__).resolve().parents[3]
    subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "there.npz")],
        cwd=root,
        env=os.environ
        | {"PYTHONPATH": str(root), "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": "1"},
        check=True,
    )
    assert kept.read_bytes() == (tmp_path / "there.npz").read_bytes()


def test_another_seed_trains_another_map(kept):
    q = postures_inside(nominal_model(), 5)
    one, other = (
        jmm.lengths(q) for jmm in (JointMuscleMap.load(kept), train(nominal_model(), 1, QUICK)[0])
    )
    assert np.abs(one - other).max() > 1e-7


def test_progress_reaches_the_end_of_every_group():
    heard: dict[str, list[float]] = {}
    train(nominal_model(), 0, QUICK, lambda name, done: heard.setdefault(name, []).append(done))
    assert list(heard) == list(GROUPS)
    for done in heard.values():
        assert done == sorted(done)
        assert done[-1] == 1.0


# The cache


def test_the_second_time_the_map_is_read(tmp_path, monkeypatch):
    trained, first = load_or_train(nominal_model(), 0, tmp_path / "cache", QUICK)
    monkeypatch.setattr("jmm_agent.mapping.training.TorchProcess", None)
    read, second = load_or_train(nominal_model(), 0, tmp_path / "cache", QUICK)
    assert (first.cached, second.cached) == (False, True)
    q = postures_inside(nominal_model(), 5)
    np.testing.assert_array_equal(read.lengths(q), trained.lengths(q))
    for name, group in second.groups.items():
        assert group.validation_rmse == first.groups[name].validation_rmse


@pytest.fixture
def quickly(monkeypatch, kept):
    """Training returns the map that was trained before; the list has what was trained."""
    trained, (jmm, report) = [], load_or_train(nominal_model(), 0, kept.parent, QUICK)

    def train_again(*given):
        trained.append(given[1:])
        return jmm, replace(report, cached=False)

    monkeypatch.setattr("jmm_agent.mapping.training.train", train_again)
    return trained


@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_a_broken_cache_file_is_reported_and_the_map_is_trained_again(
    tmp_path, caplog, kept, quickly, content
):
    trained, path = JointMuscleMap.load(kept), tmp_path / kept.name
    path.write_bytes(kept.read_bytes()[:-300] if content is None else content)
    with caplog.at_level(logging.WARNING, "jmm_agent"):
        again, report = load_or_train(nominal_model(), 0, tmp_path, QUICK)
    assert "cut off or damaged" in caplog.text
    assert "trained again" in caplog.text
    assert quickly == [(0, QUICK, None)]
    assert not report.cached
    q = postures_inside(nominal_model(), 5)
    np.testing.assert_array_equal(again.lengths(q), trained.lengths(q))
    np.testing.assert_array_equal(JointMuscleMap.load(path).lengths(q), trained.lengths(q))


def test_a_map_of_another_robot_under_this_name_is_replaced(tmp_path, caplog, kept, quickly):
    path, ours = tmp_path / kept.name, JointMuscleMap.load(kept)
    JointMuscleMap(ours.joints, tuple("abcdefgh"), ours.groups).save(path)
    jmm, report = load_or_train(nominal_model(), 0, tmp_path, QUICK)
    assert "another robot" in caplog.text
    assert len(quickly) == 1
    assert not report.cached
    assert jmm.muscles == JointMuscleMap.load(path).muscles == nominal_model().muscles


def test_a_cache_that_cannot_be_written_is_reported(tmp_path, caplog, quickly):
    (tmp_path / "cache").write_text("a file where the folder should be")
    jmm, _ = load_or_train(nominal_model(), 0, tmp_path / "cache", QUICK)
    assert "could not be kept" in caplog.text
    assert np.isfinite(jmm.lengths(np.zeros(6))).all()


def stretched(q):
    return 1.001 * relative_lengths(q)


@pytest.mark.parametrize(
    "other",
    [
        {"lengths": stretched},
        {"upper": np.deg2rad([40, 40, 30, 50, 50, 21])},
        {"muscles": tuple("abcdefgh")},
        {"groups": {"base": JOINTS[:4], "tip": JOINTS[4:]}},
    ],
)
def test_the_hash_differs_between_nominal_models(other):
    assert content_hash(nominal_model(**other), 0, QUICK) != content_hash(nominal_model(), 0, QUICK)


def test_the_hash_differs_between_seeds_and_recipes():
    hashes = {
        content_hash(nominal_model(), 0, QUICK),
        content_hash(nominal_model(), 1, QUICK),
        content_hash(nominal_model(), 0, replace(QUICK, ridge=1e-3)),
    }
    assert len(hashes) == 3
    assert content_hash(nominal_model(), 0, QUICK) in hashes


def test_maps_that_another_method_trained_have_other_names(monkeypatch):
    ours = content_hash(nominal_model(), 0, QUICK)
    monkeypatch.setattr("jmm_agent.mapping.training.METHOD", "another")
    assert content_hash(nominal_model(), 0, QUICK) != ours
