"""Checkpoints: an interrupted diagnosis continues with the same bits."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.inference.checkpoint import KEY, Checkpoint, Columns, digest, forget
from reality_gap.inference.screening import CHUNK, Sensitivity, list_candidates, screen
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.study.system import compile_system

IDS = ("coulomb_friction", "viscous_friction", "length_scale", "attachment_shift", "delay")


class InterruptionError(Exception):
    """Stands for a KeyboardInterrupt."""


def chosen(study: Study) -> tuple[Candidate, ...]:
    """Return some candidates, several times: more than are screened between two checkpoints."""
    found = list_candidates(compile_system(study), [find_cause(id) for id in IDS])
    return found * (2 * CHUNK // len(found) + 1)


def screen_all(
    study: Study, checkpoint: Checkpoint, most: int = 10**6
) -> tuple[tuple[Sensitivity, ...], int]:
    """Return all sensitivities and the number of replays; interrupt after ``most`` replays."""
    count = 0

    def tick() -> None:
        nonlocal count
        count += 1
        if count > most:
            raise InterruptionError

    replayer = Replayer(study, tick=tick)
    null = replayer.residual([])
    found = screen(replayer, chosen(study), null, checkpoint)
    return found, count


def made(value: float) -> Callable[[], Columns]:
    return lambda: [np.full((2, 1), value, dtype=np.float32), np.zeros((2, 3), dtype=np.float32)]


def never() -> Columns:
    raise AssertionError("it was there already")


def test_after_an_interruption_it_goes_on_with_the_same_bits(
    lever_study: Study, tmp_path: Path
) -> None:
    undisturbed, all_replays = screen_all(lever_study, Checkpoint(None, ""))
    key = digest(lever_study, chosen(lever_study))
    with pytest.raises(InterruptionError):
        screen_all(lever_study, Checkpoint(tmp_path / "work", key), most=all_replays * 2 // 3)

    found, replays = screen_all(lever_study, Checkpoint(tmp_path / "work", key))

    assert replays < all_replays * 2 // 3
    for one, other in zip(undisturbed, found, strict=True):
        assert one.candidate == other.candidate
        np.testing.assert_array_equal(one.columns, other.columns)


def test_what_was_kept_is_found_again(tmp_path: Path) -> None:
    Checkpoint(tmp_path / "work", "k").get(3, made(5.0))

    found = Checkpoint(tmp_path / "work", "k").get(3, never)

    np.testing.assert_array_equal(found[0], np.full((2, 1), 5.0))
    assert [columns.shape for columns in found] == [(2, 1), (2, 3)]
    assert found[0].dtype == np.float32


def test_of_another_study_nothing_is_taken(tmp_path: Path) -> None:
    Checkpoint(tmp_path / "work", "one").get(0, made(1.0))

    found = Checkpoint(tmp_path / "work", "other").get(0, made(2.0))

    assert found[0][0, 0] == 2.0


@pytest.mark.parametrize("spoil", [b"", b"PK\x03\x04 not really", b"\x80\x04pickled"])
def test_a_file_that_cannot_be_read_is_made_again(tmp_path: Path, spoil: bytes) -> None:
    folder = tmp_path / "work"
    Checkpoint(folder, "k").get(0, made(1.0))
    next(folder.glob("*.npz")).write_bytes(spoil)

    assert Checkpoint(folder, "k").get(0, made(2.0))[0][0, 0] == 2.0
    assert Checkpoint(folder, "k").get(0, never)[0][0, 0] == 2.0


def test_half_written_files_are_not_taken(tmp_path: Path) -> None:
    folder = tmp_path / "work"
    Checkpoint(folder, "k").get(0, made(1.0))
    whole = next(folder.glob("*.npz")).read_bytes()
    next(folder.glob("*.npz")).write_bytes(whole[: len(whole) // 2])

    assert Checkpoint(folder, "k").get(0, made(2.0))[0][0, 0] == 2.0


def test_forgetting_leaves_other_files(tmp_path: Path) -> None:
    for name in ("own", "shared"):
        Checkpoint(tmp_path / name, "k").get(0, made(1.0))
    (tmp_path / "shared" / "thesis.txt").write_text("mine")

    for name in ("own", "shared", "missing"):
        forget(tmp_path / name)

    assert not (tmp_path / "own").exists()
    assert [path.name for path in (tmp_path / "shared").iterdir()] == ["thesis.txt"]


def test_without_a_folder_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    assert Checkpoint(None, "k").get(0, made(1.0))[0][0, 0] == 1.0
    assert list(tmp_path.iterdir()) == []


def test_the_key_depends_on_log_model_and_candidates(lever_study: Study) -> None:
    some = chosen(lever_study)
    [first, *others] = lever_study.episodes
    louder = replace(first.readings[0], value=first.readings[0].value + 1e-9)
    changed = replace(first, readings=(louder, *first.readings[1:]))
    noisier = replace(lever_study.channels[0], noise=1.0)
    keys = {
        digest(lever_study, some),
        digest(lever_study, some[:-1]),
        digest(replace(lever_study, episodes=(changed, *others)), some),
        digest(replace(lever_study, episodes=(replace(first, joints={"elbow": 0.1}),)), some),
        digest(replace(lever_study, channels=(noisier, *lever_study.channels[1:])), some),
        digest(replace(lever_study, model=_lighter(lever_study)), some),
    }

    assert len(keys) == 6
    assert digest(lever_study, some) in keys


def _lighter(study: Study) -> Path:
    path = study.model.with_name("lighter.xml")
    path.write_text(study.model.read_text().replace('mass="1"', 'mass="0.9"'))
    return path


def test_the_key_file_holds_the_key(tmp_path: Path) -> None:
    Checkpoint(tmp_path / "work", "k").get(0, made(1.0))

    assert (tmp_path / "work" / KEY).read_text() == "k"


def test_a_broken_archive_is_made_again(tmp_path: Path) -> None:
    checkpoint, path = Checkpoint(tmp_path / "work", "k"), tmp_path / "work" / "00000.npz"
    checkpoint.get(0, made(1.0))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("arr_0.npy", b"\x93NUMPY\x01\x00\x10\x00{'descr': (      \n")

    assert checkpoint.get(0, made(2.0))[0][0] == 2.0
