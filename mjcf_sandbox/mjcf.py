"""Checks of MJCF models: the files that they name, and whether MuJoCo can compile them."""

from __future__ import annotations

import hashlib
import os
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from pathlib import Path

from mjcf_sandbox import sandbox
from mjcf_sandbox.errors import UntrustedFileError, short_name

LIMITS = sandbox.Limits(seconds=10.0, cpu=4, memory=2 << 30)
"""Ten times what a model of an arm with dozens of meshes needs."""
MAX_BYTES = 64 << 20
"""Largest size of an XML file [bytes]."""

INCLUDE, ATTACH = "include", "model"
"""Elements whose ``file`` is a part of the model, and another model."""
DIRS = {"texture": ("texturedir", "assetdir")}
OTHER_DIRS = ("meshdir", "assetdir")
"""Attributes of ``compiler`` with the folder of an element's files."""

TOKEN = re.compile(
    r"""(?P<comment><!--.*?-->)|<\?.*?\?>|<[^!?<>"'](?:"[^"<]*"|'[^'<]*'|[^"'<>])*>|[^<]+""",
    re.DOTALL,
)
"""A comment, a declaration, a tag or text."""

_compiled: set[str] = set()


def check_model(model: Path, folders: Sequence[Path]) -> None:
    """Refuse a model that names files outside of folders, or that MuJoCo cannot compile.

    A worker process compiles the model, unless the same bytes were compiled before.

    Args:
        model: an MJCF file.
        folders: folders in or below which all files of the model must lie.

    Raises:
        UntrustedFileError: the model is refused.
    """
    found = hashlib.sha256()
    for file in named_files(model, folders):
        if file.is_file():
            found.update(f"{file.name} {file.stat().st_size}\n".encode() + file.read_bytes())
    key = found.hexdigest()
    if key not in _compiled:
        sandbox.run("mjcf_sandbox.trial_compile", [str(model.absolute())], LIMITS)
        _compiled.add(key)


def named_files(model: Path, folders: Sequence[Path]) -> list[Path]:
    """The model and every file that it includes, attaches or loads; some may not exist.

    Args:
        model: an MJCF file.
        folders: folders in or below which all files must lie.

    Raises:
        UntrustedFileError: a file lies elsewhere, is not XML, or attaches itself.
    """
    found: dict[Path, None] = {}
    _add_model(model.absolute(), tuple(folder.resolve() for folder in folders), found, ())
    return list(found)


def included_names(model: Path) -> list[str]:
    """Names of all files that a model and its includes include, as they are written.

    Args:
        model: an MJCF file; names start from its folder.

    Raises:
        UntrustedFileError: a file is not XML, or a name is no path.
    """
    model = model.absolute()
    elements = _elements(model, (Path(model.anchor),), {})
    return [element.get("file", "") for element in elements if element.tag == INCLUDE]


def _add_model(
    model: Path, folders: Sequence[Path], found: dict[Path, None], above: tuple[Path, ...]
) -> None:
    """Add the files of a model to ``found``; ``above`` are the models that attach it."""
    above = (*above, model.resolve())
    elements = list(_elements(model, folders, found))
    compilers = [element for element in elements if element.tag == "compiler"]
    for element in elements:
        dirs = DIRS.get(element.tag, OTHER_DIRS)
        subfolders = {compiler.get(key) for compiler in compilers for key in dirs} - {None}
        for attribute, name in element.attrib.items():
            if not attribute.startswith("file") or element.tag == INCLUDE:
                continue
            if element.tag == ATTACH:
                part = _inside(model.parent, "", name, folders)
                if part.resolve() in above:
                    raise UntrustedFileError(f"attaches itself: {part.name}")
                if part.is_file() and part not in found:
                    _add_model(part, folders, found, above)
                continue
            for subfolder in subfolders or {""}:
                found[_inside(model.parent, subfolder or "", name, folders)] = None
    for compiler in compilers:
        for key in ("meshdir", "texturedir", "assetdir"):
            _inside(model.parent, "", compiler.get(key, ""), folders)


def _elements(
    model: Path, folders: Sequence[Path], found: dict[Path, None]
) -> Iterator[ElementTree.Element]:
    """All elements of a model and of its includes, whose paths start from the model's folder."""
    pending, seen = [model], set()
    while pending:
        file = pending.pop()
        if file in seen or not file.is_file():
            continue
        seen.add(file)
        found[file] = None
        for element in _parse(file).iter():
            yield element
            if element.tag == INCLUDE and element.get("file"):
                pending.append(_inside(model.parent, "", element.get("file", ""), folders))


def _inside(base: Path, subfolder: str, name: str, folders: Sequence[Path]) -> Path:
    """Path of the file ``name`` in a subfolder of ``base``.

    MuJoCo accepts both kinds of slashes, and resolves ``..`` before it follows links.

    Raises:
        UntrustedFileError: the file lies outside of ``folders``.
    """
    written = Path(subfolder.replace("\\", "/"), name.replace("\\", "/"))
    path = Path(os.path.normpath(base / written))
    try:
        ends = (path.resolve(), (base / written).resolve())
        path.is_file()  # raises for a name that is too long
    except (OSError, RuntimeError, ValueError) as error:
        raise UntrustedFileError(
            f"names {short_name(name)!r}, which is not a valid path of a file"
        ) from error
    if not all(any(end.is_relative_to(folder) for folder in folders) for end in ends):
        raise UntrustedFileError(
            f"names {short_name(str(written))}, which lies outside {folders[0]}; copy it there"
        )
    return path


def _parse(file: Path) -> ElementTree.Element:
    """The root element of an XML file.

    MuJoCo's parser accepts more than XML allows and could see elements that Python's does not. So
    text that the two might read differently is refused, except two hyphens in a comment.
    """
    if file.stat().st_size > MAX_BYTES:
        raise UntrustedFileError(f"cannot be read: {file.name} has more than {MAX_BYTES >> 20} MiB")
    text = file.read_bytes().decode("utf-8", "replace").removeprefix("\ufeff")
    kept, end = [], 0
    for token in TOKEN.finditer(text):
        if token.start() != end:
            break
        end = token.end()
        kept.append("\n" * token[0].count("\n") if token["comment"] else token[0])
    if end != len(text):
        line = text.count("\n", 0, end) + 1
        raise UntrustedFileError(
            f"cannot be read: {file.name}, line {line}, is not XML, or has a DTD"
        )
    try:
        return ElementTree.fromstring("".join(kept))
    except ElementTree.ParseError as error:
        raise UntrustedFileError(
            f"cannot be read: {file.name} is not well-formed XML: {error}"
        ) from error
