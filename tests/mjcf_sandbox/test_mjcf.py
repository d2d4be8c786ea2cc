"""Hostile models are refused with one sentence, and read no file outside their folder."""

from __future__ import annotations

import os
from pathlib import Path

import mujoco
import numpy as np
import pytest

from kengoro_env.errors import KengoroError
from kengoro_env.robot.model_file import load_spec
from mjcf_sandbox import sandbox
from mjcf_sandbox.errors import UntrustedFileError
from mjcf_sandbox.mjcf import check_model, named_files

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
GOOD = """<?xml version="1.0"?>
<!-- ---- one body ---- -->
<mujoco>
  <compiler meshdir="meshes"/>
  <asset><mesh name="m" file="bone.obj"/><model name="part" file="part/part.xml"/></asset>
  <worldbody>
    <body><freejoint/><geom type="mesh" mesh="m"/></body>
    <attach model="part" body="knob" prefix="a_"/>
    <include file="more.xml"/>
  </worldbody>
</mujoco>
"""
PART = """<mujoco>
  <asset><mesh name="m" file="../meshes/bone.obj"/></asset>
  <worldbody><body name="knob"><geom type="mesh" mesh="m"/></body></worldbody>
</mujoco>
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with parts of models, beside files that it must not read."""
    folder = tmp_path / "study"
    for name in ("meshes", "part", "a/b"):
        (folder / name).mkdir(parents=True)
    (folder / "deep").symlink_to("a/b")
    (folder / "escape").symlink_to("..")
    (folder / "loop").symlink_to("loop")
    (folder / "meshes" / "bone.obj").write_text(TETRAHEDRON)
    (folder / "part" / "part.xml").write_text(PART)
    (folder / "more.xml").write_text("<mujoco><body/></mujoco>")
    (folder / "inner.xml").write_text("<mujoco><include file='../secret.xml'/></mujoco>")
    (tmp_path / "secret.xml").write_text("<mujoco/>")
    (tmp_path / "secret.obj").write_text(TETRAHEDRON)
    return folder


def write(folder: Path, text: str) -> Path:
    path = folder / "model.xml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_good_model_names_what_lies_in_its_folder(folder: Path) -> None:
    model = write(folder, GOOD)
    check_model(model, [folder])
    found = {file.relative_to(folder).as_posix() for file in named_files(model, [folder])}
    assert found == {"model.xml", "more.xml", "part/part.xml", "meshes/bone.obj"}


def test_the_same_bytes_are_tried_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tries: list[str] = []
    monkeypatch.setattr(sandbox, "run", lambda module, *rest: tries.append(module))
    model = write(folder, "<mujoco model='tried'/>")
    check_model(model, [folder])
    check_model(model, [folder])
    assert len(tries) == 1
    write(folder, "<mujoco model='changed'/>")
    check_model(model, [folder])
    assert len(tries) == 2


MESH = (
    "<mujoco>{}<asset><mesh name='m' file='{}'/></asset>"
    "<worldbody><geom type='mesh' mesh='m'/></worldbody></mujoco>"
)
OUTSIDE = {
    "include": "<mujoco><include file='../secret.xml'/></mujoco>",
    "included include": "<mujoco><include file='inner.xml'/></mujoco>",
    "model": "<mujoco><asset><model file='../secret.xml'/></asset></mujoco>",
    "mesh": MESH.format("", "../secret.obj"),
    "absolute": MESH.format("", "{secret}"),
    "backslash": MESH.format("", "..\\secret.obj"),
    "meshdir": MESH.format("<compiler meshdir='..'/>", "secret.obj"),
    "assetdir": MESH.format("<compiler assetdir='..'/>", "secret.obj"),
    "stripped": MESH.format("<compiler meshdir='..' strippath='true'/>", "study/secret.obj"),
    "link": MESH.format("", "escape/secret.obj"),
    "link before dots": MESH.format("", "deep/../../secret.obj"),
    "texture": "<mujoco><asset><texture fileup='../secret.png'/></asset></mujoco>",
    "flexcomp": "<mujoco><worldbody><flexcomp file='../secret.obj'/></worldbody></mujoco>",
    "urdf": "<robot><mesh filename='../secret.obj'/></robot>",
}


@pytest.mark.parametrize("kind", OUTSIDE)
def test_a_model_may_not_name_what_lies_elsewhere(folder: Path, kind: str) -> None:
    model = write(folder, OUTSIDE[kind].format(secret=folder.parent / "secret.obj"))
    with pytest.raises(
        UntrustedFileError, match=r"^names .*, which lies outside .*; copy it there"
    ):
        check_model(model, [folder])


HIDDEN = {
    "in an entity": (
        f'<!DOCTYPE m [<!ENTITY a "> {MESH.format("", "../secret.obj")} ">]><mujoco/>'
    ),
    "between comments in names": (
        '<mujoco><asset><mesh name="<!--"/><mesh name="m" file="../secret.obj"/>'
        '<mesh name="-->"/></asset><worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>'
    ),
    "after the end": MESH.format("", "../secret.obj") + "<mujoco/>",
}


@pytest.mark.parametrize("kind", HIDDEN)
def test_what_two_parsers_may_read_differently_is_refused(folder: Path, kind: str) -> None:
    secret = folder.parent / "secret.obj"
    os.utime(secret, (1, 1))
    model = write(folder, HIDDEN[kind])
    with pytest.raises(UntrustedFileError, match=r"^cannot be read: model.xml"):
        check_model(model, [folder])
    assert secret.stat().st_atime == 1


REFUSED = {
    "attaches itself": (
        "<mujoco><asset><model name='a' file='model.xml'/></asset><worldbody><body name='b'/>"
        "<attach model='a' body='b' prefix='x'/></worldbody></mujoco>",
        "attaches itself: model.xml",
    ),
    "includes itself": ("<mujoco><include file='model.xml'/></mujoco>", "does not compile: .*"),
    "a hole in memory": (
        "<mujoco><asset><hfield name='h' nrow='65536' ncol='65537' size='1 1 1 1'/></asset>"
        "<worldbody><geom type='hfield' hfield='h'/></worldbody></mujoco>",
        r"crashes its reader \(SIGSEGV\)",
    ),
    "more memory than there is": (
        "<mujoco><asset><hfield name='h' nrow='100000' ncol='100000' size='1 1 1 1'/></asset>"
        "</mujoco>",
        "asks for more memory than a model may have",
    ),
    "no XML": ("mujoco", "cannot be read: model.xml is not well-formed XML: .*"),
    "a name too long": (
        MESH.format("", 300 * "x"),
        r"names 'x{200}\.\.\.', which is not a valid path of a file",
    ),
    "a long path outside": (
        MESH.format("", f"../{100 * 'folder/'}x.obj"),
        r"names \.\./[folder/]{197}\.\.\., which lies outside .*; copy it there",
    ),
    "a model's name too long": (
        f"<mujoco><asset><model name='m' file='{300 * 'x'}'/></asset></mujoco>",
        "names .*, which is not a valid path of a file",
    ),
    "an included name too long": (
        f"<mujoco><include file='{300 * 'x'}'/></mujoco>",
        "names .*, which is not a valid path of a file",
    ),
    "a loop of links": (
        MESH.format("", "loop/x.obj"),
        "names .*, which is not a valid path of a file",
    ),
    "too little memory to simulate": (
        "<mujoco><size memory='1'/><worldbody><body><freejoint/><geom size='1'/></body>"
        "<geom type='plane' size='1 1 1'/></worldbody></mujoco>",
        "does not compile: .*",
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_mujoco_does_not_survive_is_refused(folder: Path, kind: str) -> None:
    text, sentence = REFUSED[kind]
    with pytest.raises(UntrustedFileError, match=f"^{sentence}$") as caught:
        check_model(write(folder, text), [folder])
    assert "\n" not in str(caught.value)


def test_a_model_that_takes_for_ever_is_given_up(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mjcf_sandbox.mjcf.LIMITS", sandbox.Limits(1.0, 10, 2 << 30))
    many = "<replicate count='1000000000' offset='0 0 1'><geom size='.1'/></replicate>"
    model = write(folder, f"<mujoco><worldbody>{many}</worldbody></mujoco>")
    with pytest.raises(UntrustedFileError, match=r"^takes longer than 1 s to read$"):
        check_model(model, [folder])


def test_the_environments_refuse_hostile_models_too(folder: Path) -> None:
    with pytest.raises(KengoroError, match=r"model.xml attaches itself: model.xml$"):
        load_spec(write(folder, REFUSED["attaches itself"][0]))
    with pytest.raises(KengoroError, match=r"model.xml names .*, which lies outside"):
        load_spec(write(folder, OUTSIDE["mesh"]))


def bits(model: mujoco.MjModel) -> bytes:
    buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def test_the_sandbox_changes_no_bit(folder: Path) -> None:
    model = write(folder, GOOD)
    sandboxed, plain = load_spec(model).compile(), mujoco.MjModel.from_xml_path(str(model))
    assert bits(sandboxed) == bits(plain)
