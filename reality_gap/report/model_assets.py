"""Model assets: copies meshes and textures into a folder beside a written model."""

from __future__ import annotations

import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
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
"""Attributes that contain a file name, by element."""


def write_model(
    xml: str, original: Path, path: Path, copied: Mapping[Path, str] | None = None
) -> dict[Path, str]:
    """Write a model with its assets in a folder beside it, and check that it can be loaded.

    The text of `mujoco.MjSpec.to_xml` contains file names relative to the folder of the original
    model, so that it cannot be loaded from elsewhere.

    Args:
        xml: text of ``to_xml``.
        original: file from which the model was read.
        path: file to write, in an existing folder.
        copied: names of the files that are in the folder of assets already; none by default.

    Returns:
        Names of all files that are there now.

    Raises:
        StudyError: a file of the model was not found, or the model cannot be loaded.
    """
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(xml, parser)
    compiler = root.find("compiler")
    folders = {} if compiler is None else dict(compiler.attrib)
    copies = dict(copied or {})
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
        raise StudyError(f"the extended model of {original} cannot be loaded: {reason}") from error
    return copies


def _find(original: Path, folder: str, name: str) -> Path:
    """Return a file of a model; the names of attached models' files lack the folder."""
    direct = original.parent / folder / name
    if direct.is_file():
        return direct.resolve()
    found = sorted(p for p in original.parent.rglob(escape(Path(name).name)) if p.is_file())
    if len(found) != 1:
        count = f"{len(found)} files" if found else "no file"
        raise StudyError(
            f"the model {original} needs the file {name}; there must be one of this name in the "
            f"folder of the model, but there is {count}"
        )
    return found[0].resolve()


def _free(file: Path, copies: dict[Path, str]) -> str:
    """Return the file's name, or one with a number if another file already has it."""
    name, taken = file.name, set(copies.values())
    number = 1
    while name in taken:
        number += 1
        name = f"{file.stem}_{number}{file.suffix}"
    return name


def _copy(copies: dict[Path, str], folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for source, name in copies.items():
        if not (folder / name).exists():
            shutil.copyfile(source, folder / name)
