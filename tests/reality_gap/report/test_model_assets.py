"""Model assets: meshes and textures are copied with an extended model."""

from __future__ import annotations

import shutil
from pathlib import Path

import imageio.v3 as imageio
import mujoco
import numpy as np
import pytest

from reality_gap.errors import StudyError
from reality_gap.report.model_assets import write_model

TETRAHEDRON = """v 0 0 0
v {0} 0 0
v 0 {0} 0
v 0 0 {0}
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""
MODEL = """
<mujoco>
  <compiler meshdir="meshes" texturedir="pictures"/>
  <asset>
    <mesh name="small" file="left/bone.obj"/>
    <mesh name="large" file="right/bone.obj"/>
    <texture name="skin" type="2d" file="skin.png"/>
    <texture name="sky" type="skybox" builtin="flat" width="8" height="8"/>
    <material name="skin" texture="skin"/>
  </asset>
  <worldbody>
    <body><freejoint/><geom type="mesh" mesh="small" material="skin"/></body>
    <body pos="1 0 0"><freejoint/><geom type="mesh" mesh="large"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def original(tmp_path: Path) -> Path:
    """A model with two meshes of the same file name and a texture."""
    folder = tmp_path / "original"
    for side, size in (("left", 0.1), ("right", 0.3)):
        (folder / "meshes" / side).mkdir(parents=True)
        (folder / "meshes" / side / "bone.obj").write_text(TETRAHEDRON.format(size))
    (folder / "pictures").mkdir()
    imageio.imwrite(folder / "pictures" / "skin.png", np.zeros((8, 8, 3), np.uint8))
    (folder / "model.xml").write_text(MODEL)
    return folder / "model.xml"


def test_the_written_model_can_be_loaded_without_the_original(
    original: Path, tmp_path: Path
) -> None:
    spec = mujoco.MjSpec.from_file(str(original))
    expected = spec.compile()
    out = tmp_path / "out"
    out.mkdir()

    write_model(spec.to_xml(), original, out / "extended.xml")
    shutil.rmtree(original.parent)
    moved = out.rename(tmp_path / "elsewhere")

    model = mujoco.MjModel.from_xml_path(str(moved / "extended.xml"))
    assert sorted(path.name for path in (moved / "assets").iterdir()) == [
        "bone.obj",
        "bone_2.obj",
        "skin.png",
    ]
    np.testing.assert_allclose(model.body_mass, expected.body_mass, rtol=1e-5)
    assert model.ntex == expected.ntex


def test_files_of_an_attached_model_are_found_by_name(original: Path, tmp_path: Path) -> None:
    part = original.parent / "part"
    (part / "forms").mkdir(parents=True)
    (part / "forms" / "knob[1].obj").write_text(TETRAHEDRON.format(0.2))
    (part / "part.xml").write_text(
        '<mujoco><compiler meshdir="forms"/><asset><mesh name="knob" file="knob[1].obj"/></asset>'
        '<worldbody><body name="knob"><geom type="mesh" mesh="knob"/></body></worldbody></mujoco>'
    )
    text = MODEL.replace("<asset>", '<asset><model name="part" file="part/part.xml"/>').replace(
        "</worldbody>", '<attach model="part" body="knob" prefix="a_"/></worldbody>'
    )
    original.write_text(text)
    (tmp_path / "out").mkdir()

    xml = mujoco.MjSpec.from_file(str(original)).to_xml()
    write_model(xml, original, tmp_path / "out" / "extended.xml")

    assert (tmp_path / "out" / "assets" / "knob[1].obj").is_file()


def test_a_missing_file_is_named(original: Path, tmp_path: Path) -> None:
    xml = mujoco.MjSpec.from_file(str(original)).to_xml()
    (original.parent / "pictures" / "skin.png").unlink()

    with pytest.raises(StudyError, match=r"skin\.png.*but there is no file"):
        write_model(xml, original, tmp_path / "extended.xml")
