"""The files that a model names, copied beside a written model."""

from __future__ import annotations

import shutil
import xml.etree.ElementTree as ElementTree
from glob import escape
from pathlib import Path

import mujoco

from reality_gap.errors import StudyError

FOLDER = "assets"
FACES = ("right", "left", "up", "down", "front", "back")
NAMED = {
    "mesh": ("file",),
    "hfield": ("file",),
    "skin": ("file",),
    "texture": ("file", *(f"file{face}" for face in FACES)),
}
"""Attributes with a file's name, by element."""


def write_model(xml: str, original: Path, path: Path) -> None:
    """Write a model to ``path`` with its assets in a folder beside it, and load it once.

    `mujoco.MjSpec.to_xml` keeps the names of files but not the place from where they are looked
    for, so that its text loads only where the original lies.

    Args:
        xml: of `to_xml`.
        original: the file that the model was read from.
        path: where to write; its parent exists.

    Raises:
        StudyError: a file that the model names was not found, or the model does not load.
    """
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(xml, parser)
    compiler = root.find("compiler")
    folders = {} if compiler is None else dict(compiler.attrib)
    copies: dict[Path, str] = {}
    for kind, attributes in NAMED.items():
        folder = folders.get("texturedir" if kind == "texture" else "meshdir", "")
        for element in root.iter(kind):
            for attribute in attributes:
                name = element.get(attribute)
                if name is not None:
                    found = _find(original, folder, name)
                    element.set(attribute, copies.setdefault(found, _free(found, copies)))
    if not copies:
        path.write_text(xml, encoding="utf-8")
    else:
        assert compiler is not None, "to_xml always writes a compiler element"
        compiler.set("meshdir", FOLDER)
        compiler.set("texturedir", FOLDER)
        _copy(copies, path.parent / FOLDER)
        path.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    try:
        mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise StudyError(f"the extended model of {original} does not load: {reason}") from error


def _find(original: Path, folder: str, name: str) -> Path:
    """A model's file; those of attached models lose their folder and are searched for by name."""
    direct = original.parent / folder / name
    if direct.is_file():
        return direct.resolve()
    found = sorted(p for p in original.parent.rglob(escape(Path(name).name)) if p.is_file())
    if len(found) != 1:
        how = f"in {len(found)} places" if found else "nowhere"
        raise StudyError(f"{name}, which the model {original} names, is {how} in its folder")
    return found[0].resolve()


def _free(file: Path, copies: dict[Path, str]) -> str:
    """The file's own name, or one with a number if another file has it."""
    name, taken = file.name, set(copies.values())
    number = 1
    while name in taken:
        number += 1
        name = f"{file.stem}_{number}{file.suffix}"
    return name


def _copy(copies: dict[Path, str], folder: Path) -> None:
    folder.mkdir()
    for source, name in copies.items():
        shutil.copyfile(source, folder / name)
