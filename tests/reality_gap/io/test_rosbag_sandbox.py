"""Sandbox for bags: a bag that its reader cannot handle is refused in one sentence."""

from __future__ import annotations

import errno
import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from mjcf_sandbox import sandbox
from mjcf_sandbox.errors import SandboxError, UntrustedFileError
from reality_gap.__main__ import main as run
from reality_gap.errors import StudyError
from reality_gap.io import rosbag_sandbox
from reality_gap.io.rosbag_sandbox import main, unpack_in_sandbox
from tests.reality_gap.io.recordings import write_mcap


def test_a_file_that_is_not_a_bag(tmp_path: Path) -> None:
    bag = tmp_path / "run.bag"
    bag.write_bytes(b"#ROSBAG V2.0\n" + b"\xff" * 100)
    with pytest.raises(StudyError, match=r"^run.bag cannot be read as a bag: "):
        unpack_in_sandbox(bag, tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.bag"]


def test_a_bag_that_crashes_its_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def crash(*arguments: object) -> None:
        raise SandboxError("crashes its reader (SIGSEGV)")

    monkeypatch.setattr(sandbox, "run", crash)
    (tmp_path / "run.mcap").write_bytes(b"")
    with pytest.raises(StudyError, match=r"^run.mcap crashes its reader \(SIGSEGV\)$"):
        unpack_in_sandbox(tmp_path / "run.mcap", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_bag_with_a_link_to_another_folder(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "secret.db3").write_bytes(b"")
    (tmp_path / "run" / "run.db3").symlink_to("../secret.db3")
    expected = r"^run contains a link to .*secret.db3; replace the link by the file"
    with pytest.raises(StudyError, match=expected):
        unpack_in_sandbox(tmp_path / "run", tmp_path / "out")


def test_a_folder_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="is not overwritten"):
        unpack_in_sandbox(tmp_path / "run.bag", tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of the size of files")
def test_a_full_disk_is_named(tmp_path: Path) -> None:
    """A limit of the size of files stands for the full disk."""
    import resource

    bag = write_mcap(tmp_path / "run.mcap", numbers(500))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        with pytest.raises(StudyError, match=r"^there is no space left for .*/logs: the disk is"):
            unpack_in_sandbox(bag, tmp_path / "logs")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_each_error_of_a_full_disk_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(rosbag_sandbox, "unpack", fail)
    with pytest.raises(UntrustedFileError, match="there is no space left for"):
        main(task(tmp_path))


def test_another_error_of_the_system_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "run.mcap")

    monkeypatch.setattr(rosbag_sandbox, "unpack", fail)
    expected = r"^run.mcap cannot be unpacked: Permission denied \(run.mcap\)$"
    with pytest.raises(UntrustedFileError, match=expected):
        main(task(tmp_path))


def test_a_disk_too_full_for_the_reason_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object) -> None:
        raise SandboxError("makes its reader fail")

    monkeypatch.setattr(sandbox, "run", fail)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: shutil._ntuple_diskusage(9, 9, 0))
    (tmp_path / "run.mcap").write_bytes(b"")
    with pytest.raises(StudyError, match="there is no space left for"):
        unpack_in_sandbox(tmp_path / "run.mcap", tmp_path / "logs")


def test_out_through_a_dangling_link_is_a_sentence(tmp_path: Path) -> None:
    bag = write_mcap(tmp_path / "run.mcap", numbers(3))
    (tmp_path / "logs").symlink_to(tmp_path / "gone" / "logs")
    with pytest.raises(StudyError, match=r"logs is a link to .*/gone/logs, which does not exist"):
        unpack_in_sandbox(bag, tmp_path / "logs")
    assert not (tmp_path / "gone").exists()


def test_what_was_left_out_comes_back_from_the_sandbox(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [*numbers(3), ("/cbor", "cbor", "", "", b"", 0.0, b"")]
    bag = write_mcap(tmp_path / "run.mcap", rows)

    assert run(["unpack", str(bag), "--out", str(tmp_path / "logs")]) == 0

    printed = capsys.readouterr().out
    assert "note: /cbor is left out: its messages are encoded as 'cbor'" in printed
    assert f"wrote {tmp_path}/logs/n.csv" in printed


def test_episodes_are_for_datasets(tmp_path: Path) -> None:
    bag = write_mcap(tmp_path / "run.mcap", numbers(3))
    with pytest.raises(StudyError, match=r"run.mcap is no LeRobot dataset: --episodes is for"):
        unpack_in_sandbox(bag, tmp_path / "logs", episodes=[0])


def numbers(count: int) -> list[tuple[Any, ...]]:
    """Messages with a number."""
    return [("/n", "json", "", "", b"", 0.01 * i, b'{"x": %d.123456}' % i) for i in range(count)]


def task(folder: Path) -> str:
    """Task of the worker."""
    paths = {"bag": str(folder / "run.mcap"), "out": str(folder / "logs")}
    paths["notes"] = str(folder / "notes")
    return json.dumps({**paths, "topics": [], "by_arrival": False, "types": None, "episodes": []})
