"""Tables: logs are read as numbers, and errors name the line and column of a wrong cell."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reality_gap.errors import StudyError
from reality_gap.io import tables
from reality_gap.io.tables import read_header, read_table


def read(path: Path, content: str | bytes) -> tables.Table:
    """Columns a and b of a CSV file with this content."""
    path = path / "log.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_table(path, "log.csv", ("a", "b"))


@pytest.mark.parametrize(
    "content",
    [
        "a,b\n1,2\n3,4\n",
        "b,a\n2,1\n4,3\n",
        "a,note,b\n1,begin,2\n3,,4\n",
        "\ufeffa, b \r\n1, 2\r\n3,4",
        '"a","b"\n"1","2"\n3e0,+4.\n\n\n',
        'a,"a note, long",b\n1,"x,\ny",2\n3,z,4\n',
    ],
)
def test_usual_forms_of_csv_are_read(tmp_path: Path, content: str) -> None:
    columns = read(tmp_path, content).columns
    np.testing.assert_array_equal(columns["a"], [1.0, 3.0])
    np.testing.assert_array_equal(columns["b"], [2.0, 4.0])


@pytest.mark.parametrize("empty", ["", " ", '""'])
def test_an_empty_cell(tmp_path: Path, empty: str) -> None:
    columns = read(tmp_path, f"a,b\n1,{empty}\n3,4\n").columns
    np.testing.assert_array_equal(columns["b"], [np.nan, 4.0])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "log.csv is empty"),
        ("a,b\n", "no rows"),
        ("a;b\n1;2\n", "separated by ';'; use commas"),
        ("a\tb\n1\t2\n", "use commas"),
        ("a,b\n1,2\n3\n", "line 3 of log.csv has 1 cells, the header 2; the file looks truncated"),
        ("a,b\n1\n3,4\n", "line 2 of log.csv has 1 cells, the header 2$"),
        ("a,b\n1,2\n3,4,5\n", "line 3 of log.csv has 3 cells, the header 2$"),
        ("a,b\n1,2\n3,4x\n", "line 3 of log.csv, column 'b': '4x' is not a number"),
        ("a,b\n1,2\nNaN,4\n", "line 3 of log.csv, column 'a': 'nan' is not a number"),
        ("a,b\n1,2\n3,-inf\n", "line 3 of log.csv, column 'b': '-inf' is not a number"),
        ("a,b\n1,2\n3,1e999\n", "line 3 of log.csv, column 'b'"),
        ("a,b,a\n1,2,3\n", "2 columns named 'a'"),
        (b"a,b\n1,2\n\xff,4\n", "line 3 of log.csv, column 'a'"),
        (b"\xff\xfea,b\n1,2\n", "UTF-8"),
    ],
)
def test_a_fault_of_a_csv_file(tmp_path: Path, content: str | bytes, words: str) -> None:
    with pytest.raises(StudyError, match=words):
        read(tmp_path, content)


def test_parquet(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    columns = {"b": pa.array([2, None], pa.int32()), "a": pa.array([1.0, 3.0], pa.float32())}
    pyarrow.parquet.write_table(pa.table(columns), path)
    assert read_header(path, "log.parquet") == ("b", "a")
    table = read_table(path, "log.parquet", ("a", "b"))
    np.testing.assert_array_equal(table.columns["a"], [1.0, 3.0])
    np.testing.assert_array_equal(table.columns["b"], [2.0, np.nan])
    assert table.location(1) == "row 2 of log.parquet"


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ([1.0, float("nan")], "row 2 of log.parquet, column 'a': 'nan'"),
        (["1", "x"], "row 2 of log.parquet, column 'a': 'x'"),
        ([[1.0], [2.0]], "instead of numbers"),
    ],
)
def test_a_fault_of_a_parquet_file(tmp_path: Path, cells: list, words: str) -> None:
    path = tmp_path / "log.parquet"
    pyarrow.parquet.write_table(pa.table({"a": cells}), path)
    with pytest.raises(StudyError, match=words):
        read_table(path, "log.parquet", ("a",))


def test_column_names_of_a_parquet_file_that_are_not_text(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    pyarrow.parquet.write_table(pa.table({"length": [1.0, 2.0]}), path, store_schema=False)
    path.write_bytes(path.read_bytes().replace(b"length", b"le\xe7gth"))
    with pytest.raises(StudyError, match=r"^log.parquet is not a Parquet file, or is truncated"):
        read_header(path, "log.parquet")


def test_a_truncated_parquet_file(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    pyarrow.parquet.write_table(pa.table({"a": [1.0, 2.0]}), path)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(StudyError, match="truncated"):
        read_header(path, "log.parquet")


def test_files_that_are_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "log.parquet"
    pyarrow.parquet.write_table(pa.table({"a": np.zeros(1000)}), path)
    monkeypatch.setattr(tables, "MAX_CELLS", 999)
    with pytest.raises(StudyError, match="1000 cells"):
        read_table(path, "log.parquet", ("a",))
    monkeypatch.setattr(tables, "MAX_BYTES", 10)
    with pytest.raises(StudyError, match="MiB"):
        read(tmp_path, "a,b\n1,2\n3,4\n")


def test_a_message_is_one_line_without_control_characters(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"line 2 of log.csv, column 'a': .*is not a number") as e:
        read(tmp_path, 'a,b\n"1\n\x1b[2J",2\n')
    assert str(e.value).isprintable()
    assert str(StudyError("a\r\nb\x1b[2J")) == r"a b\x1b[2J"
    assert len(str(StudyError("x" * 9999))) < 2100


def test_a_short_row_need_not_be_text(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "log.csv").write_bytes(b"a,b\n1,2\n\xff\xfe\n3,4\n")
    with pytest.raises(StudyError, match=r"line 3 of log.csv has 1 cells, the header 2$"):
        read_table(tmp_path / "log.csv", "log.csv", ("a",))
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("header", [b"a" * 200_000, b"a\rb,c"])
def test_a_header_that_cannot_be_read(tmp_path: Path, header: bytes) -> None:
    (tmp_path / "log.csv").write_bytes(header + b"\n1\n")
    with pytest.raises(StudyError, match=r"^log.csv has no line of column names: "):
        read_header(tmp_path / "log.csv", "log.csv")


@pytest.mark.parametrize("cell", ["1e31", "-1e300"])
def test_a_number_that_is_too_large_is_refused(tmp_path: Path, cell: str) -> None:
    with pytest.raises(StudyError, match="is not a number"):
        read(tmp_path, f"a,b\n1,2\n{cell},4\n")


CELLS = st.sampled_from([b"1", b"", b'"', b"1\n", b",", b"\r", b"\xff", b"nan", b"1e999", b"x\0"])


@given(st.lists(CELLS, max_size=12))
def test_any_csv_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, cells: list[bytes]
) -> None:
    path = tmp_path_factory.mktemp("any") / "log.csv"
    path.write_bytes(b"a,b\n" + b"".join(cells))
    with contextlib.suppress(StudyError):
        assert len(read_table(path, "log.csv", ("a",)).columns["a"])


@pytest.mark.parametrize(
    "content",
    [
        "# recorded by hand\na,b\n1,2\n3,4\n",
        "# robot: left\n# rate: 50 Hz\na,b\n1,2\n3,4\n",
        "# a,b\n1,2\n3,4\n",  # as numpy.savetxt writes it
        "\ufeff# note\r\na,b\r\n1,2\r\n3,4\r\n",
    ],
)
def test_comments_above_the_header(tmp_path: Path, content: str) -> None:
    columns = read(tmp_path, content).columns
    np.testing.assert_array_equal(columns["a"], [1.0, 3.0])
    np.testing.assert_array_equal(columns["b"], [2.0, 4.0])


def test_lines_are_counted_with_the_comments(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"line 4 of log.csv, column 'b': 'x' is not a number"):
        read(tmp_path, "# note\na,b\n1,2\n3,x\n")
    with pytest.raises(StudyError, match=r"line 4 of log.csv has 1 cells, the header 2; .* trunc"):
        read(tmp_path, "# note\na,b\n1,2\n3\n")


@pytest.mark.parametrize("cells", ["[0.1, 0.2]", "[0.1 0.2]", "(0.1, 0.2)", "[ 0.1  0.2 ]"])
def test_lists_in_cells_become_columns(tmp_path: Path, cells: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f'time,q\n0,"{cells}"\n1,\n2,"[3, 4]"\n')
    assert read_header(path, "log.csv") == ("time", "q.0", "q.1")
    columns = read_table(path, "log.csv", ("q.1", "time", "q.0")).columns
    np.testing.assert_array_equal(columns["q.0"], [0.1, np.nan, 3.0])
    np.testing.assert_array_equal(columns["q.1"], [0.2, np.nan, 4.0])


@pytest.mark.parametrize("fixed", [True, False])
def test_lists_in_parquet_become_columns(tmp_path: Path, fixed: bool) -> None:
    path = tmp_path / "LOG.PARQUET"
    kind = pa.list_(pa.float32(), 2) if fixed else pa.list_(pa.float32())
    pyarrow.parquet.write_table(pa.table({"q": pa.array([[1, 2], None, [3, 4]], kind)}), path)
    assert read_header(path, "log") == ("q.0", "q.1")
    columns = read_table(path, "log", ("q.1",)).columns
    np.testing.assert_array_equal(columns["q.1"], [2.0, np.nan, 4.0])


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("[1, 2, 3]", "is no list of 2 numbers, as in the first row"),
        ("[1, x]", "is not a number"),
        ("1", "is no list of 2 numbers"),
    ],
)
def test_a_fault_of_a_list(tmp_path: Path, cell: str, words: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f'q\n"[1, 2]"\n"{cell}"\n')
    with pytest.raises(StudyError, match=f"line 3 of log.csv, column 'q': .*{words}"):
        read_table(path, "log.csv", ("q.0",))


@pytest.mark.parametrize("form", ["{}T{}", "{} {}Z", "{} {}+00:00"])
def test_times_in_iso_8601_are_seconds(tmp_path: Path, form: str) -> None:
    path = tmp_path / "log.csv"
    times = [form.format("2024-05-01", f"12:00:00.{i}") for i in ("000", "020")]
    path.write_text("time\n" + "\n".join(times) + "\n")
    time = read_table(path, "log.csv", ("time",)).columns["time"]
    np.testing.assert_allclose(time - 1_714_564_800, [0.0, 0.02], atol=1e-6)


def test_times_in_parquet_are_seconds(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    times = pa.array([1_714_564_800_000, 1_714_564_800_020], pa.timestamp("ms", "UTC"))
    pyarrow.parquet.write_table(pa.table({"time": times}), path)
    time = read_table(path, "log.parquet", ("time",)).columns["time"]
    np.testing.assert_allclose(time - 1_714_564_800, [0.0, 0.02], atol=1e-6)


def test_a_time_that_does_not_exist(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"line 2 of log.csv, column 'a': '2024-13-01T00:00' is"):
        read(tmp_path, "a,b\n2024-13-01T00:00,1\n")
