"""Sandbox for bags: a bag that its reader cannot handle is refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from mjcf_sandbox import sandbox
from mjcf_sandbox.errors import SandboxError
from reality_gap.errors import StudyError
from reality_gap.io.rosbag_sandbox import unpack_in_sandbox


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
