"""The model of a study needs no file of what is only seen."""

from __future__ import annotations

from pathlib import Path

import mujoco

from kengoro.robots import arm_scene
from kengoro.study_model import study_model
from kengoro_env.robot.muscle_law import DEFAULT_GAINS

WEDGE = "vertex='0 0 0 0.03 0 0 0 0.04 0 0 0 0.05'"


def test_a_study_of_the_arm_has_no_visuals() -> None:
    spec = study_model(arm_scene())
    arm = mujoco.MjModel.from_xml_path(str(arm_scene()))
    assert not spec.meshes
    named = {arm.geom(g).name for g in range(arm.ngeom)} - {""}
    assert {geom.name for geom in spec.geoms} == named
    mujoco.MjModel.from_xml_string(spec.to_xml())


def test_meshes_that_touch_or_weigh_something_stay(tmp_path: Path) -> None:
    path = tmp_path / "finger.xml"
    path.write_text(
        f"<mujoco><asset><mesh name='tip' {WEDGE}/><mesh name='cover' {WEDGE}/></asset><worldbody>"
        "<site name='a' pos='0.02 0 0'/><body pos='0 0 0.1'><joint name='j' axis='0 1 0' "
        "range='-40 40'/><geom name='tip' type='mesh' mesh='tip' mass='0.1'/>"
        "<geom name='cover' type='mesh' mesh='cover' mass='0' contype='0' conaffinity='0'/>"
        "<site name='b' pos='0.02 0 0.03'/></body></worldbody>"
        "<tendon><spatial name='m'><site site='a'/><site site='b'/></spatial></tendon></mujoco>"
    )
    spec = study_model(path, DEFAULT_GAINS)
    assert [mesh.name for mesh in spec.meshes] == ["tip"]
    assert [geom.name for geom in spec.geoms] == ["tip"]
