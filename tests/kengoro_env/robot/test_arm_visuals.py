"""The robot's visuals: what is only seen, on the bodies of arm.xml."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest

from kengoro_env import actual
from kengoro_env.assets import asset_path
from kengoro_env.departures import BoneWrapping, Payload, TendonStretch
from kengoro_env.names import JOINTS
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.muscle_law import DEFAULT_GAINS
from kengoro_env.robot.robot import Robot
from kengoro_env.types import Floats
from kengoro_env.vision.rendering import COARSE, QUALITY

FOLDER = asset_path("mjcf/kengoro_arm/arm.xml").parent
MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
SHOWN = 3
"""Number of geom groups that MuJoCo draws by default: 0, 1 and 2."""
MOST_FACES = 30_000
ON_SURFACE = 0.002
"""Largest distance between a wire's end and a visual of its body [m]."""


@pytest.fixture(scope="module")
def arm() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(FOLDER / "arm.xml"))


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of arm.xml and can_grasp.xml without visuals."""
    folder = tmp_path_factory.mktemp("bare")
    for name in ("arm", "can_grasp"):
        text = (FOLDER / f"{name}.xml").read_text("utf-8")
        text = re.sub(r' *<(geom class="visual_\w+" mesh|mesh file)="\w+(\.obj)?"/>\n', "", text)
        text = text.replace('texturedir="textures"', f'texturedir="{FOLDER / "textures"}"')
        assert "_bone.obj" not in text
        (folder / f"{name}.xml").write_text(text, encoding="utf-8")
    return folder


def visuals(model: mujoco.MjModel) -> list[int]:
    """Numbers of the geoms that are meshes."""
    return [g for g in range(model.ngeom) if model.geom_type[g] == MESH]


def triangles(model: mujoco.MjModel, geom: int) -> Floats:
    """Corners (k, 3, 3) of a mesh geom's faces in the frame of its body [m]."""
    mesh = model.mesh(int(model.geom_dataid[geom]))
    first, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
    vertices = model.mesh_vert[first : first + count].astype(float)
    first, count = int(mesh.faceadr[0]), int(mesh.facenum[0])
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    vertices = vertices @ turn.reshape(3, 3).T + model.geom_pos[geom]
    return np.asarray(vertices[model.mesh_face[first : first + count]])


def distance(point: Floats, faces: Floats) -> float:
    """Least distance of a point (3,) from triangles (k, 3, 3)."""
    a, b, c = np.moveaxis(faces, 1, 0)
    found = []
    for one, other in ((a, b), (b, c), (c, a)):  # from the edges
        along = other - one
        share = np.einsum("ki,ki->k", point - one, along) / np.einsum("ki,ki->k", along, along)
        found.append(np.linalg.norm(one + np.clip(share, 0, 1)[:, None] * along - point, axis=1))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.einsum("ki,ki->k", point - a, normal)
    foot = point - height[:, None] * normal
    sides = [
        np.einsum("ki,ki->k", np.cross(other - one, foot - one), normal)
        for one, other in ((a, b), (b, c), (c, a))
    ]
    inside = np.all(np.array(sides) >= 0, axis=0)
    found.append(np.where(inside, np.abs(height), np.inf))
    return float(np.min(found))


def test_distances_from_a_triangle() -> None:
    faces = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    for point, expected in (((0.2, 0.2, 0.5), 0.5), ((-0.3, 0.5, 0.4), 0.5), ((3, 0, 0), 2.0)):
        assert distance(np.array(point), faces) == pytest.approx(expected)


def test_tendons_end_on_a_visual_of_their_body(arm: mujoco.MjModel) -> None:
    """Each point of each of the 36 wires, in the nominal model."""
    sites = {int(arm.wrap_objid[w]) for w in range(arm.nwrap)}
    assert len(sites) > 72
    far = {}
    for site in sites:
        body = arm.site_bodyid[site]
        faces = [triangles(arm, g) for g in visuals(arm) if arm.geom_bodyid[g] == body]
        gap = distance(arm.site_pos[site], np.vstack(faces))
        if gap > ON_SURFACE:
            far[arm.site(site).name] = round(1e3 * gap, 2)
    assert far == {}


def test_a_mesh_is_named_after_its_body_or_part_and_its_colour(arm: mujoco.MjModel) -> None:
    assert len(visuals(arm)) == arm.nmesh
    for geom in visuals(arm):
        part, colour = arm.mesh(int(arm.geom_dataid[geom])).name.rsplit("_", 1)
        assert {"jaw": "head"}.get(part, part) == arm.body(int(arm.geom_bodyid[geom])).name
        same = [g for g in visuals(arm) if arm.mesh(int(arm.geom_dataid[g])).name.endswith(colour)]
        assert np.ptp(arm.geom_rgba[same], axis=0).max() == 0.0


def test_the_meshes_are_those_that_the_script_writes(tmp_path: Path) -> None:
    script = FOLDER / "visuals" / "make_visuals.py"
    subprocess.run([sys.executable, str(script), str(tmp_path)], check=True)
    written, shipped = (
        {path.name: path.read_text("utf-8").splitlines() for path in folder.glob("*")}
        for folder in (tmp_path, FOLDER / "meshes")
    )
    assert set(written) == set(shipped)
    for name, lines in written.items():
        kinds = [[line.split()[0] for line in each] for each in (lines, shipped[name])]
        assert kinds[0] == kinds[1], name
        for one, other in zip(lines, shipped[name], strict=True):
            if one.startswith("v"):  # other versions of NumPy may round otherwise
                values = [np.array(line.split()[1:], dtype=float) for line in (one, other)]
                step = 1.1e-5 if one.startswith("v ") else 1.1e-2
                np.testing.assert_allclose(*values, rtol=0, atol=step)
            else:
                assert one == other, name


def test_visuals_touch_nothing_and_are_shown_and_the_rest_of_the_arm_is_not(
    arm: mujoco.MjModel,
) -> None:
    seen = visuals(arm)
    assert not arm.geom_contype[seen].any()
    assert not arm.geom_conaffinity[seen].any()
    assert (arm.geom_group[seen] < SHOWN).all()
    others = sorted(set(range(arm.ngeom)) - set(seen) - {arm.geom("marker_plate").id})
    assert (arm.geom_group[others] >= SHOWN).all()


SEEN = re.compile(r"^_|geom|mesh|bvh|tex|mat_|name|paths|dof_length")
"""Arrays of a model that say what is seen of it and how it is called, and ``dof_length``, a size by
which MuJoCo puts bodies to sleep that do not move, which no scene asks for."""


@pytest.mark.parametrize("scene", ["arm", "can_grasp"])
def test_the_model_without_visuals_has_the_same_bits(scene: str, bare: Path) -> None:
    one, other = (
        mujoco.MjModel.from_xml_path(str(folder / f"{scene}.xml")) for folder in (FOLDER, bare)
    )
    assert one.ngeom > other.ngeom
    fields = [name for name in dir(one) if isinstance(getattr(one, name, None), np.ndarray)]
    compared = [name for name in fields if not SEEN.search(name)]
    assert len(compared) > 150
    for name in compared:
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    assert not one.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP
    assert one.stat.meaninertia == other.stat.meaninertia
    assert one.stat.meanmass == other.stat.meanmass
    kept = [g for g in range(one.ngeom) if g not in visuals(one)]
    for name in fields:
        array = getattr(one, name)
        if name.startswith("geom_") and len(array) == one.ngeom and name != "geom_matid":
            assert array[kept].tobytes() == getattr(other, name).tobytes(), name


@pytest.mark.parametrize("scene", ["arm", "can_grasp"])
def test_the_arm_without_visuals_moves_with_the_same_bits(scene: str, bare: Path) -> None:
    models = [
        mujoco.MjModel.from_xml_path(str(folder / f"{scene}.xml")) for folder in (FOLDER, bare)
    ]
    one, other = (mujoco.MjData(model) for model in models)
    rng = np.random.default_rng(0)
    for posture in posture_set()[::250]:
        for model, data in zip(models, (one, other), strict=True):
            mujoco.mj_resetData(model, data)
            data.qpos[[model.joint(joint).qposadr[0] for joint in JOINTS]] = posture
        one.qvel[:] = other.qvel[:] = rng.normal(0.0, 0.3, len(one.qvel))
        for _ in range(300):
            mujoco.mj_step(models[0], one)
            mujoco.mj_step(models[1], other)
            assert same_bits(one, other)


def same_bits(one: mujoco.MjData, other: mujoco.MjData) -> bool:
    """Whether two states are the same: positions, velocities and lengths of tendons."""
    return all(
        getattr(one, name).tobytes() == getattr(other, name).tobytes()
        for name in ("qpos", "qvel", "ten_length")
    )


ROBOTS: dict[str, Sequence[Departure]] = {
    "nominal": (),
    "actual": actual(3),
    "loaded": (BoneWrapping(1.1), TendonStretch(1e-5), Payload(0.3)),
}


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("scene", ["arm", "can_grasp"])
def test_a_robot_without_visuals_moves_with_the_same_bits(
    scene: str, robot: str, bare: Path
) -> None:
    one, other = (
        Robot(folder / f"{scene}.xml", ROBOTS[robot], DEFAULT_GAINS) for folder in (FOLDER, bare)
    )
    start, target = posture_set()[10], posture_set()[500]
    for each in (one, other):
        each.reset(start, np.random.default_rng(0))
    lengths = one.lengths - 0.01 * np.sign(target.sum())
    for k in range(60):
        for each in (one, other):
            each.close_fingers(-1.0 if k < 30 else 1.0)
            each.step(lengths + 0.01 * np.sin(0.1 * k))
        assert same_bits(one.data, other.data)
        assert one.measured_tensions().tobytes() == other.measured_tensions().tobytes()


@pytest.mark.parametrize("quality", [QUALITY, COARSE])
@pytest.mark.parametrize("scene", ["arm", "can_grasp", "posture"])
def test_a_scene_has_at_most_thirty_thousand_faces(scene: str, quality: dict[str, int]) -> None:
    model = mujoco.MjModel.from_xml_path(str(FOLDER / f"{scene}.xml"))
    assert 5_000 < faces(model, quality) <= MOST_FACES


def faces(model: mujoco.MjModel, quality: dict[str, int]) -> int:
    """Number of triangles of all geoms that are drawn, and of the wires, which are boxes."""
    around, along = quality["numslices"], quality["numstacks"]
    box = 6 * 2 * quality["numquads"] ** 2
    kinds = {
        int(mujoco.mjtGeom.mjGEOM_PLANE): 2,
        int(mujoco.mjtGeom.mjGEOM_BOX): box,
        int(mujoco.mjtGeom.mjGEOM_CYLINDER): 2 * around * (along + 2),
    }
    total = box * sum(int(num) - 1 for num in model.tendon_num)
    for geom in range(model.ngeom):
        if model.geom_group[geom] < SHOWN:
            mesh = int(model.geom_dataid[geom])
            kind = int(model.geom_type[geom])
            total += int(model.mesh_facenum[mesh]) if kind == MESH else kinds[kind]
    return total


def test_the_head_camera_sees_no_part_of_the_head(arm: mujoco.MjModel) -> None:
    """In a picture that is a quarter wider and higher than its frame, as that of a lens."""
    data = mujoco.MjData(arm)
    mujoco.mj_forward(arm, data)
    eye, head = arm.camera("eye").id, arm.body("head").id
    height = 1.25 * np.tan(np.radians(arm.cam_fovy[eye]) / 2)
    grid = np.stack(np.meshgrid(np.linspace(-4 / 3, 4 / 3, 33), np.linspace(-1, 1, 25)), -1)
    rays = np.insert(height * grid.reshape(-1, 2), 2, -1.0, axis=1)
    rays = rays @ data.cam_xmat[eye].reshape(3, 3).T
    shown = (np.arange(6) < SHOWN).astype(np.uint8)
    for ray in rays:
        hit = np.zeros(1, np.int32)
        mujoco.mj_ray(arm, data, data.cam_xpos[eye], ray, shown, 1, -1, hit)
        assert hit[0] < 0 or arm.geom_bodyid[hit[0]] != head


def test_no_visual_hides_the_marker_of_the_hand(arm: mujoco.MjModel) -> None:
    """From the head camera, in every tenth posture of the set."""
    data, plate = mujoco.MjData(arm), arm.geom("marker_plate").id
    eye, marker = arm.camera("eye").id, arm.site("marker_hand").id
    position = [arm.joint(joint).qposadr[0] for joint in JOINTS]
    corners = 0.025 * np.array([(x, y, 0.0) for x in (-1, 0, 1) for y in (-1, 0, 1)])
    shown = (np.arange(6) < SHOWN).astype(np.uint8)
    for posture in posture_set()[::10]:
        data.qpos[position] = posture
        mujoco.mj_kinematics(arm, data)
        mujoco.mj_camlight(arm, data)
        points = data.site_xpos[marker] + corners @ data.site_xmat[marker].reshape(3, 3).T
        for ray in points - data.cam_xpos[eye]:
            hit = np.zeros(1, np.int32)
            mujoco.mj_ray(arm, data, data.cam_xpos[eye], ray, shown, 1, -1, hit)
            assert hit[0] == plate
