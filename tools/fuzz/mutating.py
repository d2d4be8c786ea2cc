"""Random changes that make a valid file malformed: some know its format, others change bytes."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

NUMBERS = (
    *("0", "-1", "1", "2", "1e9", "-1e9", "1e308", "1e-308", "nan", "inf", "-inf", "1e999"),
    *("2147483647", "2147483648", "4294967296", "9223372036854775808", "0x7f", "1_000", "٣"),
)
PATHS = (
    *("../secret.xml", "..", "../secret.obj", "/etc/passwd", "a\\..\\..\\secret.obj", "model.xml"),
    *("part.xml", "more.xml", "STUDY.yaml", "log.csv", ".", "/", "~/secret", "file:../secret.obj"),
    *("forms/../../secret.csv", "../secret.csv", "a" * 5000, "con", "/dev/zero", "\x01"),
)
WORDS = (
    *("", " ", "true", "null", "first_reading", "<script>alert(1)</script>", "{{7*7}}", "%s%n"),
    *("é", "\u202e", "\ud7ff", "[red]", "name", "time", "elbow", "flexor", "world", "a" * 70_000),
)
YAML = (
    *("[]", "{}", "[1, 2]", "{a: b}", "!!python/object/apply:os.system [touch PWNED]", "&a [*a]"),
    *("!!binary aGk=", "2026-01-01", "0o17", "~", "? a", "|\n  text", "<<: {a: b}", "1:2:3"),
    *("!!python/name:os.system", "!!set {a}", "!!omap [a: b]", "!!timestamp 9999-99-99", "@", "`"),
    *("[" * 3000, "{a: " * 3000, "&a [1,1]\nb: &b [*a,*a]\nc: [*b,*b]", "!!float .inf", "'\\x00'"),
)
ELEMENTS = (
    "<replicate count='1000000000' offset='0 0 1'><geom size='.1'/></replicate>",
    "<replicate count='3' offset='0 0 1'><body><freejoint/><geom size='.1'/></body></replicate>",
    "<include file='more.xml'/>",
    "<include file='../secret.xml'/>",
    "<model name='self' file='model.xml'/>",
    "<attach model='self' body='lever' prefix='z'/>",
    "<attach model='part' body='knob' prefix='y'/>",
    "<texture name='t' type='2d' builtin='flat' width='40000' height='40000'/>",
    "<hfield name='h' nrow='65536' ncol='65537' size='1 1 1 1'/>",
    "<flexcomp name='f' type='grid' count='99 99 99' spacing='.1 .1 .1'/>",
    "<flexcomp name='g' type='mesh' file='../secret.obj'/>",
    "<mesh name='m' file='../secret.obj'/>",
    "<mesh name='n' vertex='0 0 0 1 0 0 0 1 0 0 0 nan'/>",
    "<mesh name='o' builtin='sphere' params='9'/>",
    "<composite type='cable' count='1000000 1 1' size='1'><geom size='.1'/></composite>",
    "<frame><frame><frame euler='nan 0 0'/></frame></frame>",
    "<size memory='100G'/>",
    "<size nuserdata='2000000000'/>",
    "<option timestep='0'/>",
    "<option timestep='1e-300' iterations='2147483647'/>",
    "<compiler meshdir='../..' strippath='true'/>",
    "<compiler coordinate='global' autolimits='false' balanceinertia='true'/>",
    "<extension><plugin plugin='mujoco.pid'/></extension>",
    "<numeric name='n' size='2000000000' data='1'/>",
    "<text name='t' data='x'/>",
    "<user name='u' dim='2000000000'/>",
    "<body><joint type='ball'/><joint type='free'/><geom size='1'/></body>",
    "<weld body1='lever' body2='world'/>",
    "<!-- -- -->",
    "<![CDATA[ <include file='../secret.xml'/> ]]>",
    "<!DOCTYPE m [<!ENTITY a '> <include file=\"../secret.xml\"/> '>]>",
)
PIECE = {
    "xml": re.compile(rb"""(?<==["'])[^"']*(?=["'])"""),
    "yaml": re.compile(rb"""(?<=: )[^\s,{}\[\]]+|(?<=[\[ ])[\w.]+(?=[\],])"""),
    "csv": re.compile(rb"[^,\n]+"),
    "json": re.compile(rb"(?<=: )[^,\n]+"),
    "text": re.compile(rb"[^\s]+"),
}
"""By format: pieces that may be replaced (attributes, values, cells, words)."""
TAG = re.compile(rb"<[a-z]+[^<>]*/>")
NAME = re.compile(rb"(?<=[\s<])[a-z_]+(?==|\s)")
FORMATS = {
    ".xml": "xml",
    ".yaml": "yaml",
    ".csv": "csv",
    ".json": "json",
    ".obj": "text",
}
"""Formats by suffix; other files are changed as bytes."""

Mutation = Callable[[bytes, np.random.Generator], bytes]


def mutate(name: str, data: bytes, random: np.random.Generator) -> bytes:
    """Change a file one to four times.

    Args:
        name: of the file; its suffix chooses the changes.
        data: its bytes.
        random: random numbers.

    Returns:
        The new bytes.
    """
    kind = FORMATS.get(Path(name).suffix, "bytes")
    mutations: tuple[Mutation, ...] = (change_bytes,)
    if kind != "bytes":
        mutations = (
            *(lambda d, r: swap_piece(kind, d, r),) * 6,
            copy_line,
            drop_line,
            change_bytes,
        )
    if kind == "xml":
        mutations = (*mutations, *(add_element,) * 3, swap_names, drop_tag)
    if Path(name).suffix == ".npz":
        mutations = (change_bytes, change_member, change_member, change_member)
    for _ in range(random.integers(1, 5)):
        data = mutations[random.integers(len(mutations))](data, random)
    return data


def swap_piece(kind: str, data: bytes, random: np.random.Generator) -> bytes:
    """Replace a value by an extreme one, or by another value of the same file."""
    found = list(PIECE[kind].finditer(data))
    if not found:
        return data
    piece = found[random.integers(len(found))]
    pools: list[tuple[str, ...]] = [NUMBERS, WORDS, PATHS]
    if kind == "yaml":
        pools.append(YAML)
    pools.append(tuple(other[0].decode("utf-8", "replace") for other in found))
    pool = pools[random.integers(len(pools))]
    new = pool[random.integers(len(pool))].encode("utf-8", "surrogatepass")
    if kind == "xml":
        new = new.replace(b"<", b"&lt;") if random.random() < 0.9 else new
    return data[: piece.start()] + new + data[piece.end() :]


def copy_line(data: bytes, random: np.random.Generator) -> bytes:
    """Copy a line to another position."""
    lines = data.split(b"\n")
    line, at = random.integers(len(lines), size=2)
    return b"\n".join([*lines[:at], lines[line], *lines[at:]])


def drop_line(data: bytes, random: np.random.Generator) -> bytes:
    """Remove a line."""
    lines = data.split(b"\n")
    del lines[random.integers(len(lines))]
    return b"\n".join(lines)


def add_element(data: bytes, random: np.random.Generator) -> bytes:
    """Insert an extreme element after another one."""
    locations = [found.end() for found in re.finditer(rb">", data)] or [0]
    at = locations[random.integers(len(locations))]
    element = ELEMENTS[random.integers(len(ELEMENTS))].encode()
    return data[:at] + element + data[at:]


def drop_tag(data: bytes, random: np.random.Generator) -> bytes:
    """Remove an element that has no content."""
    found = list(TAG.finditer(data))
    if not found:
        return data
    tag = found[random.integers(len(found))]
    return data[: tag.start()] + data[tag.end() :]


def swap_names(data: bytes, random: np.random.Generator) -> bytes:
    """Rename an element or attribute to the name of another one."""
    found = list(NAME.finditer(data))
    if not found:
        return data
    one, other = found[random.integers(len(found))], found[random.integers(len(found))]
    return data[: one.start()] + other[0] + data[one.end() :]


def change_member(data: bytes, random: np.random.Generator) -> bytes:
    """Change bytes of a member of an archive, and its checksum accordingly."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            content = {name: archive.read(name) for name in archive.namelist()}
    except Exception:  # an earlier change may have broken the archive
        return change_bytes(data, random)
    if not content:
        return data
    name = list(content)[random.integers(len(content))]
    if random.random() < 0.1:
        del content[name]
    elif random.random() < 0.3:
        shapes = (b"(9999999999999,)", b"(-1,)", b"()", b"(2, 3, 4)", b"(1.5,)", b"[[" * 90)
        shape = shapes[random.integers(len(shapes))]
        content[name] = re.sub(rb"\([^()]*\)", lambda _: shape, content[name], count=1)
    else:
        content[name] = change_bytes(content[name], random)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, member in content.items():
            archive.writestr(name, member)
    return buffer.getvalue()


def change_bytes(data: bytes, random: np.random.Generator) -> bytes:
    """Flip, overwrite, remove or repeat bytes, or cut the file off."""
    if not data:
        return random.bytes(8)
    at, end = sorted(random.integers(len(data) + 1, size=2).tolist())
    end = min(end, at + 64)
    match int(random.integers(7)):
        case 0:
            return data[:at] + random.bytes(end - at) + data[end:]
        case 1:
            return data[:at]
        case 2:
            return data[:at] + data[end:]
        case 3:
            return data[:end] + data[at:end] + data[end:]
        case 4:
            extremes = (b"\xff\xff\xff\xff", b"\x7f", b"\x00\x00\x00\x00", b"\x80", b"\n", b'"')
            value = extremes[random.integers(len(extremes))]
            return data[:at] + value + data[at + len(value) :]
        case 5:
            return (
                data[:at]
                + bytes([data[at % len(data)] ^ (1 << random.integers(8))])
                + data[at + 1 :]
            )
        case _:
            return (
                data[:at]
                + bytes([random.integers(256)]) * int(random.integers(1, 5000))
                + data[at:]
            )
