"""Tables as other programs export them: the runs are the same as those of a plain CSV file."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from reality_gap.errors import StudyError
from reality_gap.io.dates import seconds_of
from reality_gap.io.recordings import Run, read_runs

TIME = 0.02 * np.arange(100)
VALUES = np.round(np.sin(3.0 * TIME), 6)
HALF_PAST = datetime(2024, 10, 27, 23, 59, 59)


def text_of(separator: str = ",", decimal: str = ".", head: str = "time,q") -> str:
    rows = [
        f"{t:.2f}{separator}{q}".replace(".", decimal) for t, q in zip(TIME, VALUES, strict=True)
    ]
    return "\n".join([head.replace(",", separator), *rows]) + "\n"


def stamped(write: Callable[[datetime], str]) -> str:
    stamps = [write(HALF_PAST + timedelta(seconds=float(t))) for t in TIME]
    rows = [f"{t},{q}" for t, q in zip(stamps, VALUES, strict=True)]
    return "\n".join(["time,q", *rows]) + "\n"


def runs_of(
    folder: Path, content: str | bytes, name: str = "log.csv"
) -> tuple[list[Run], list[str]]:
    path, notes = folder / name, list[str]()
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_runs(path, notes.append), notes


PLAIN = text_of()
LAYOUTS: dict[str, str | bytes] = {
    "semicolons and decimal commas": text_of(";", ","),
    "semicolons and decimal points": text_of(";"),
    "mark of a spreadsheet": "\ufeffsep=;\r\n" + text_of(";", ",").replace("\n", "\r\n"),
    "tabs": text_of("\t"),
    "blanks": text_of("   "),
    "UTF-16": text_of().encode("utf-16"),
    "Windows-1252": text_of(head="time,q,\u00b0")
    .replace("\n", ",1\n")
    .replace("\u00b0,1", "\u00b0")
    .encode("cp1252"),
    "lines above the names": "Device: arm 7\nOperator;x\n\n" + text_of(),
    "units below the names": text_of().replace("time,q\n", "time,q\ns,rad\n"),
    "names that are repeated": text_of().replace("\n0.50,", "\ntime,q\n0.50,"),
    "a comment in the middle": text_of().replace("\n0.50,", "\n# pause\n0.50,"),
    "dates with points": stamped(lambda t: t.strftime("%d.%m.%Y %H:%M:%S.%f")),
    "dates with slashes": stamped(lambda t: t.strftime("%m/%d/%Y %I:%M:%S.%f %p")),
    "times of day over midnight": stamped(lambda t: t.strftime("%H:%M:%S.%f")),
    "a zone": stamped(lambda t: t.strftime("%Y-%m-%d %H:%M:%S.%f UTC")),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_runs_are_those_of_a_plain_file(tmp_path: Path, layout: str) -> None:
    [run], _ = runs_of(tmp_path, LAYOUTS[layout])
    name = next(column for column in run.columns if column.startswith("q"))
    np.testing.assert_allclose(run.time - run.time[0], TIME, atol=1e-5)
    np.testing.assert_allclose(run.columns[name], VALUES, atol=1e-9)


@pytest.mark.parametrize("word", ["NaN", "N/A", "-", "null", "inf", "#N/A"])
def test_words_for_what_was_not_measured(tmp_path: Path, word: str) -> None:
    lines = PLAIN.splitlines()
    lines[31] = f"0.60,{word}"
    [run], _ = runs_of(tmp_path, "\n".join(lines))
    assert np.flatnonzero(np.isnan(run.columns["q"])).tolist() == [30]


def test_a_row_that_was_cut_off_is_left_out_and_named(tmp_path: Path) -> None:
    [run], notes = runs_of(tmp_path, PLAIN[: PLAIN.rindex(",")])
    assert len(run.time) == 99
    assert any("line 101" in note for note in notes)


def test_a_stamp_in_seconds_and_nanoseconds(tmp_path: Path) -> None:
    whole = np.floor(1e8 + TIME).astype(int)
    rest = np.round(1e9 * (TIME % 1.0)).astype(int)
    rows = [f"{s},{n},{q}" for s, n, q in zip(whole, rest, VALUES, strict=True)]
    [run], _ = runs_of(tmp_path, "\n".join(["stamp.sec,stamp.nanosec,q", *rows]))
    np.testing.assert_allclose(run.time - run.time[0], TIME, atol=1e-6)
    assert list(run.columns) == ["q"]


def test_a_column_that_rises_is_the_time(tmp_path: Path) -> None:
    [run], notes = runs_of(tmp_path, text_of(head="x,q"))
    np.testing.assert_allclose(run.time, TIME)
    assert any("x, which rises, is taken as it" in note for note in notes)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (PLAIN.split("\n", 1)[1], "first line of log.csv holds numbers"),
        ("", "empty"),
        ("a story\nwithout numbers\n", "no line of log.csv holds column names"),
        ("time,q\n" + "1.7e9,0.5\n" * 50, "too few digits"),
    ],
)
def test_what_is_no_log(tmp_path: Path, content: str, words: str) -> None:
    with pytest.raises(StudyError, match=words):
        runs_of(tmp_path, content)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="there is no file"):
        read_runs(tmp_path / "log.csv", print)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("01:00:02.5", 3602.5),
        ("12:00:00 AM", 0.0),
        ("1.1.1970 00:00:10", 10.0),
        ("13/1/1970 00:00:00", 12 * 86400.0),
        ("1970-01-01T01:00:00+01:00", 0.0),
        ("32.1.1970 00:00:00", None),
        ("elbow", None),
        ("1.5", None),
    ],
)
def test_dates(text: str, seconds: float | None) -> None:
    assert seconds_of(text) == seconds
