"""Files are written whole or not at all, and what prevents it is named in a sentence."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

import experiments.__main__
import kengoro.__main__
import reality_gap.__main__
from mjcf_sandbox import files
from mjcf_sandbox.errors import OutputError
from mjcf_sandbox.files import check_folder, check_links, write_text


@pytest.mark.parametrize("below", ["", "run", "run/log.csv"])
def test_a_link_that_leads_nowhere_is_a_sentence(tmp_path: Path, below: str) -> None:
    link = tmp_path / "link"
    link.symlink_to("gone")

    expected = rf"^{link} is a link to gone, which does not exist; make that first, or choose"
    with pytest.raises(OutputError, match=expected):
        check_links(link / below)
    with pytest.raises(OutputError, match=expected):
        write_text(link / below, "text")
    assert not (tmp_path / "gone").exists()
    (tmp_path / "gone").mkdir()
    check_links(link / below)


@pytest.mark.parametrize("below", ["", "run", "run/robots"])
def test_a_file_where_a_folder_must_be_is_a_sentence(
    tmp_path: Path, below: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("text")
    with pytest.raises(OutputError, match=rf"^{file} is no folder; choose another path$"):
        check_folder(file / below)
    assert experiments.__main__.main(["learnability", "--out", str(file / below)]) == 2
    assert capsys.readouterr().err == f"{file} is no folder; choose another path\n"
    check_folder(tmp_path / "new" / below)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_full_disk_is_named_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    (tmp_path / "log.csv").write_text("before")

    def fail(handle: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(files.os, "fsync", fail)
    with pytest.raises(OutputError, match=r"^there is no space left for .*log.csv: the disk is"):
        write_text(tmp_path / "log.csv", "after")
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]
    assert (tmp_path / "log.csv").read_text() == "before"


@pytest.mark.parametrize(
    ("main", "arguments"),
    [
        (kengoro.__main__.main, ["record", "--arm", "elbow"]),
        (experiments.__main__.main, ["learnability"]),
        (reality_gap.__main__.main, ["init", "model.xml", "log.csv"]),
        (reality_gap.__main__.main, ["diagnose", "STUDY.yaml"]),
        (reality_gap.__main__.main, ["unpack", "run.bag"]),
    ],
)
def test_each_command_checks_its_out_before_it_computes(
    main: object, arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "link").symlink_to("gone")
    assert callable(main)

    assert main([*arguments, "--out", str(tmp_path / "link" / "out")]) == 2

    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{tmp_path / 'link'} is a link to gone, which does not exist; ")
    assert not (tmp_path / "gone").exists()
