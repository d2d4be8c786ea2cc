"""LeRobot datasets: converts their episodes to CSV files that a study can use.

Reads the layouts of the versions 2 and 3: Parquet files below ``data``, one or many episodes each,
and ``meta/info.json``, which names the entries of arrays. Videos are left out.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet

from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.io.new_folder import check_new, new_folder

INFO = Path("meta/info.json")
"""File that describes a dataset."""
EPISODE, TIMESTAMP = "episode_index", "timestamp"
"""Columns of the number of the episode, and of the time since its start [s]."""
COUNTERS = ("episode_index", "frame_index", "index", "task_index", "timestamp")
"""Columns that hold no measurement."""
LARGEST = 1024
"""Largest number of entries of an array; larger ones are images."""
_DAMAGED = (pa.ArrowException, OSError, UnicodeDecodeError)


def is_dataset(path: Path) -> bool:
    """Return whether a folder is a LeRobot dataset."""
    return (path / INFO).is_file()


def unpack_dataset(
    dataset: Path,
    out: Path,
    features: Sequence[str] = (),
    episodes: Sequence[int] = (),
    progress: Callable[[float], None] = lambda share: None,
    *,
    note: Callable[[str], None] = lambda sentence: None,
) -> tuple[Path, ...]:
    """Write a dataset's episodes as CSV files into a new folder, all of them or none.

    Each file has a column ``time`` [s]. The other columns are named after feature and entry, as in
    ``action.shoulder_pan.pos``. Units are those of the dataset.

    Args:
        dataset: folder that holds ``meta/info.json``.
        out: folder to create.
        features: features to write, such as "action"; by default all that hold numbers.
        episodes: numbers of the episodes to write; by default all.
        progress: called with the fraction of the dataset that has been read, 0 to 1.
        note: called with a sentence for each thing that was left out or is missing.

    Returns:
        The files, in the order of the episodes.

    Raises:
        StudyError: the dataset cannot be read, holds no numbers, or ``out`` exists.
        UnknownNameError: the dataset has no such feature.
    """
    check_new(out)
    info = _info(dataset)
    tables = _episodes(dataset, info, features, episodes, progress, note)
    for sentence in _missing(info, tables, features, episodes):
        note(sentence)
    names = []
    with new_folder(out) as folder:
        for number, parts in sorted(tables.items()):
            names.append(f"episode_{number:06d}.csv")
            table = pa.concat_tables(parts).sort_by("time")
            style = pyarrow.csv.WriteOptions(quoting_style="needed")
            pyarrow.csv.write_csv(table, folder / names[-1], style)
    return tuple(out.resolve() / name for name in names)


def _episodes(
    dataset: Path,
    info: dict[str, Any],
    features: Sequence[str],
    episodes: Sequence[int],
    progress: Callable[[float], None],
    note: Callable[[str], None],
) -> dict[int, list[pa.Table]]:
    """Read the parts of each wanted episode, as `unpack_dataset` takes and raises."""
    tables: dict[int, list[pa.Table]] = {}
    known: set[int] = set()
    files = sorted((dataset / "data").rglob("*.parquet"))
    if not files:
        raise StudyError(
            f"{dataset.name} has no Parquet file below {dataset.name}/data; valid are LeRobot "
            "datasets of the versions 2 and 3"
        )
    for i, path in enumerate(files):
        try:
            for number, part in _parts(path, info, features):
                known.add(number)
                if not episodes or number in episodes:
                    tables.setdefault(number, []).append(part())
        except _DAMAGED as error:
            note(f"{path.name} is cut off or damaged and was left out ({_short(error)})")
        progress((i + 1) / len(files))
    absent = sorted(set(episodes) - tables.keys())
    if absent and known:
        raise StudyError(
            f"{dataset.name} has no episode {absent[0]}; it has {min(known)} to {max(known)}"
        )
    if not tables:
        raise StudyError(f"{dataset.name} cannot be read: none of its files holds an episode")
    return tables


def _info(dataset: Path) -> dict[str, Any]:
    try:
        info = json.loads((dataset / INFO).read_text("utf-8"))
        if isinstance(info.get("features"), dict):
            return dict(info)
    except (OSError, ValueError, AttributeError, RecursionError):
        pass
    raise StudyError(
        f"{dataset.name}/{INFO} is not that of a LeRobot dataset: a JSON object with 'features' "
        "was expected"
    )


def _parts(
    path: Path, info: dict[str, Any], features: Sequence[str]
) -> Iterator[tuple[int, Callable[[], pa.Table]]]:
    """Yield the numbers of the episodes in a file, or of parts of them, and what makes a table."""
    with pyarrow.parquet.ParquetFile(path) as file:
        schema = file.schema_arrow
        for column in (EPISODE, TIMESTAMP):
            if column not in schema.names:
                raise StudyError(f"{path.name} has no column {column!r}, as LeRobot datasets have")
        known = [name for name in schema.names if name not in COUNTERS and _numeric(schema, name)]
        for feature in features:
            if feature not in known:
                raise UnknownNameError("feature", feature, known)
        chosen = [name for name in known if not features or name in features]
        for group in range(file.num_row_groups):
            table = file.read_row_group(
                group, columns=[EPISODE, TIMESTAMP, *chosen], use_threads=False
            )
            for number in pc.unique(table[EPISODE]).to_pylist():
                if number is not None:
                    rows = table.filter(pc.equal(table[EPISODE], number))
                    yield int(number), partial(_columns, rows, chosen, info)


def _numeric(schema: pa.Schema, name: str) -> bool:
    """Return whether a column holds numbers or arrays of them."""
    kind = schema.field(name).type
    while (
        pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    ):
        kind = kind.value_type
    return bool(
        pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)
    )


def _columns(table: pa.Table, features: Sequence[str], info: dict[str, Any]) -> pa.Table:
    """Return a table with a column for each entry of the features."""
    columns = {"time": pc.cast(table[TIMESTAMP], pa.float64())}
    for feature in features:
        cells = table[feature]
        if not pa.types.is_nested(cells.type):
            columns[feature] = _finite(pc.cast(cells, pa.float64()).to_numpy())
            continue
        rows = cells.to_pylist()
        widths = {np.size(row) for row in rows if row is not None}
        if not widths or max(widths) > LARGEST:
            continue
        if len(widths) > 1:
            raise StudyError(
                f"the feature {feature} has {min(widths)} to {max(widths)} entries in one episode"
            )
        width = widths.pop()
        empty = np.full(width, np.nan)
        values = np.array(
            [empty if row is None else np.ravel(np.array(row, dtype=float)) for row in rows]
        )
        for i, name in enumerate(_entries(info, feature, width)):
            columns[f"{feature}.{name}"] = _finite(values[:, i])
    return pa.table(columns)


def _finite(values: Any) -> pa.Array:
    return pa.array(values, mask=~np.isfinite(values))


def _entries(info: dict[str, Any], feature: str, width: int) -> list[str]:
    """Return the names of the entries of a feature, or their numbers if it names none."""
    description = info["features"].get(feature)
    names = description.get("names") if isinstance(description, dict) else None
    if isinstance(names, dict):
        lists = [part for part in names.values() if isinstance(part, list)]
        # Some datasets list names by group, others give the number of each name.
        names = [one for part in lists for one in part] if lists else list(names)
    if isinstance(names, list) and len(names) == width == len(set(map(str, names))):
        return [" ".join(str(name).split()) for name in names]
    return [str(i) for i in range(width)]


def _missing(
    info: dict[str, Any],
    tables: dict[int, list[pa.Table]],
    features: Sequence[str],
    episodes: Sequence[int],
) -> Iterator[str]:
    """Yield sentences about what the description counts or names and the files do not hold."""
    if not episodes:
        frames = sum(part.num_rows for parts in tables.values() for part in parts)
        for what, count, read in (
            ("episodes", info.get("total_episodes"), len(tables)),
            ("frames", info.get("total_frames"), frames),
        ):
            if isinstance(count, int) and count != read:
                yield f"{read} {what} were read, but {INFO} counts {count}"
    columns = next(iter(tables.values()))[0].column_names
    absent = [
        name
        for name in features or info["features"]
        if name not in COUNTERS and not any(c == name or c.startswith(f"{name}.") for c in columns)
    ]
    videos = [name for name in absent if _kind(info, name) in ("video", "image", "string")]
    if videos:
        yield f"left out, as they hold no numbers: {', '.join(videos)}"
    if others := [name for name in absent if name not in videos]:
        yield (
            f"left out, as no file holds them, or they have more than {LARGEST} entries: "
            f"{', '.join(others)}"
        )
    gaps = sum(c.null_count for parts in tables.values() for part in parts for c in part.columns)
    if gaps:
        yield f"{gaps} numbers are missing, NaN or infinite; their cells are empty"
    for feature, description in info["features"].items():
        if f"{feature}.0" in columns and isinstance(description, dict):
            yield (
                f"{INFO} does not name the entries of {feature} ({description.get('names')!r}), "
                "so that they are numbered"
            )


def _kind(info: dict[str, Any], feature: str) -> Any:
    """Return the type of data of a feature, such as "video"; None if it is not stated."""
    description = info["features"].get(feature)
    return description.get("dtype") if isinstance(description, dict) else None


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
