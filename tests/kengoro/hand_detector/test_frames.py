"""Tests of labelled frames and of the examples that are cut from them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from jmm_agent.vision.camera import Camera
from jmm_agent.vision.crop_view import hand_view, looking_at
from jmm_agent.vision.hand_detector import TrainedHandDetector
from kengoro.hand_detector.appearance import PREFIX, TEXTURES
from kengoro.hand_detector.examples import Source, chunk_path, make_chunk, shows
from kengoro.hand_detector.frames import FrameMaker, develop, load_model
from kengoro.hand_detector.hand_points import hand_geoms, hand_points
from kengoro.hand_weights import KENGORO
from kengoro_env.assets import asset_path, assets_root
from kengoro_env.robot.subtree import subtree

STRANGER = Path(__file__).with_name("two_links.xml")
SOURCES = {
    "ours": Source(asset_path("mjcf/kengoro_arm/can_grasp.xml"), "hand", "eye", ("marker_plate",)),
    "stranger": Source(STRANGER, "gripper", "above", ("tag",)),
}


def maker_without_hand(source: Source) -> FrameMaker:
    """Makes the same frames with an invisible hand."""
    model = load_model(source.model, np.random.default_rng([source.seed, 1]), source.hidden)
    within = subtree(model, model.body(source.body).id)
    model.geom_rgba[within[model.geom_bodyid], 3] = 0.0
    return FrameMaker(model, source.body, source.camera, source.count)


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_a_hand_is_at_its_label(source: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the hand, the frame differs where the label says that the hand is."""
    monkeypatch.setattr("kengoro.hand_detector.appearance.SHADOWS", 0.0)  # they are elsewhere
    maker, without = source.maker(), maker_without_hand(source)
    tested = 0
    for number in range(60):
        frame = maker.make(np.random.default_rng([5, number]))
        other = without.make(np.random.default_rng([5, number]))
        assert np.array_equal(frame.pose, other.pose)
        if frame.visible < 0.8:
            continue
        points = frame.points_in_camera(maker.points)
        pixels = points[:, :2] / points[:, 2:] * maker.focal + [319.5, 239.5]
        rows, columns = np.nonzero(np.abs(frame.image.astype(int) - other.image).max(axis=2) > 8)
        if len(rows) < 400:  # the hand has the colour of what is behind it
            continue
        tested += 1
        shown = np.array([np.quantile(columns, [0.02, 0.98]), np.quantile(rows, [0.02, 0.98])]).T
        label = np.array([pixels.min(axis=0), pixels.max(axis=0)])
        reach = float((label[1] - label[0]).max())
        assert np.abs(shown - label).max() < 0.35 * reach
        assert np.linalg.norm(shown.mean(axis=0) - label.mean(axis=0)) < 0.2 * reach
    assert tested >= 10


def test_a_calibration_has_textures_that_no_example_has() -> None:
    source = SOURCES["stranger"]
    learned, new = (texture_data(source.maker(others)._model) for others in (False, True))
    assert len(learned) == len(new) == TEXTURES
    for one in new:
        assert not any(np.array_equal(one, other) for other in learned)


def texture_data(model: mujoco.MjModel) -> list[np.ndarray]:
    """Colours of the random textures of a model."""
    ends = [*model.tex_adr[1:].tolist(), len(model.tex_data)]
    return [
        model.tex_data[model.tex_adr[i] : ends[i]]
        for i in range(model.ntex)
        if model.texture(i).name.startswith(PREFIX)
    ]


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_frames_are_of_many_kinds_and_the_same_for_the_same_seed(source: Source) -> None:
    maker = source.maker()
    frames = [maker.make(np.random.default_rng([6, number])) for number in range(30)]
    again = maker.make(np.random.default_rng([6, 7]))
    assert np.array_equal(again.image, frames[7].image)
    assert again.visible == frames[7].visible
    shares = np.array([frame.visible for frame in frames])
    assert 0.5 < np.mean(shares > 0.0) < 1.0  # some frames show no hand
    assert ((shares >= 0.0) & (shares <= 1.0)).all()
    means = np.array([frame.image.mean(axis=(0, 1)) for frame in frames])
    assert means.std(axis=0).min() > 15.0
    distances = [frame.pose[2, 3] for frame in frames if frame.visible > 0.0]
    assert max(distances) > 1.3 * min(distances)


def test_a_hidden_geom_is_not_rendered() -> None:
    """The stranger's black tag covers a part of the red palm, unless it is hidden."""
    source = SOURCES["stranger"]
    shown, hidden = replace(source, hidden=()).maker(), source.maker()
    pairs = [
        [maker.make(np.random.default_rng([7, number])) for maker in (shown, hidden)]
        for number in range(12)
    ]
    assert any((a.image != b.image).any() for a, b in pairs)


def test_points_are_of_the_hand_and_far_from_each_other() -> None:
    model = mujoco.MjModel.from_xml_path(str(STRANGER))
    body = model.body("gripper").id
    geoms = {model.geom("palm").id, model.geom("finger").id}
    points = hand_points(model, body, 8, geoms)
    assert points.shape == (8, 3)
    apart = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(8)
    assert apart.min() > 0.015
    assert points[:, 0].min() >= -1e-9
    assert points[:, 0].max() == pytest.approx(0.138, abs=1e-6)  # 0.08 + 0.05 + 0.008
    assert np.abs(points[:, 1]).max() <= 0.03 + 1e-9


def test_points_of_meshes_are_vertices_of_them() -> None:
    """The drawn hand of the arm is of meshes: each of its points lies on one."""
    maker = SOURCES["ours"].maker()
    model = mujoco.MjModel.from_xml_path(str(SOURCES["ours"].model))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hand = data.body("hand")
    vertices = []
    for number in hand_geoms(model, hand.id) - {model.geom("marker_plate").id}:
        mesh = model.mesh(model.geom_dataid[number])
        own = model.mesh_vert[int(mesh.vertadr[0]) :][: int(mesh.vertnum[0])]
        world = own @ data.geom_xmat[number].reshape(3, 3).T + data.geom_xpos[number]
        vertices.append((world - hand.xpos) @ hand.xmat.reshape(3, 3))
    distances = np.linalg.norm(np.concatenate(vertices)[:, None] - maker.points, axis=2)
    assert distances.min(axis=0).max() < 1e-5


def test_a_file_of_examples_has_crops_labelled_with_the_points(tmp_path: Path) -> None:
    source = SOURCES["stranger"]
    shown = make_chunk(source, 0, tmp_path, 30)
    with np.load(chunk_path(tmp_path, 0)) as stored:
        arrays = dict(stored)
    assert shown == arrays["cells"][:, 3].sum() > 10
    count = len(arrays["crops"])
    assert arrays["crops"].shape == (count, 128, 128, 3)
    assert arrays["positions"].shape == (count, source.count, 2)
    there = arrays["present"] == 1.0
    assert 0.1 < np.mean(~there) < 0.6
    # Around the hand the middle of its points is near the middle of the crop ...
    middles = (arrays["positions"].min(axis=1) + arrays["positions"].max(axis=1))[there] / 2.0
    assert np.median(np.linalg.norm(middles, axis=1)) < 0.3
    # ... and the points reach over a good part of it.
    reach = np.ptp(arrays["positions"], axis=1).max(axis=1)[there]
    assert 0.4 < np.median(reach) < 1.8
    cells = arrays["cells"][arrays["cells"][:, 3] == 1.0]
    rows, columns = (side / 8 for side in arrays["small"].shape[1:3])
    assert ((cells[:, 0] > -1.0) & (cells[:, 0] < columns)).all()
    assert ((cells[:, 1] > -1.0) & (cells[:, 1] < rows)).all()


def test_some_crops_show_what_a_trained_finder_offers(tmp_path: Path) -> None:
    """What it offers beside a hand, and off the hand, is what the points network must tell."""
    source = SOURCES["ours"]
    maker = source.maker()
    camera = Camera.from_fovy(maker.width, maker.height, maker.fovy)
    offers = TrainedHandDetector(camera, assets_root() / KENGORO).views
    for number, finder in enumerate((None, assets_root() / KENGORO)):
        make_chunk(source, 0, tmp_path / str(number), 12, finder)
    plain, mined = (np.load(chunk_path(tmp_path / name, 0)) for name in "01")
    assert np.array_equal(plain["small"], mined["small"])
    random = np.random.default_rng([source.seed, 2, 0])
    frame = maker.make(random)
    frame = frame._replace(image=develop(frame.image, random))
    first = offers(frame.image)[0].cut(frame.image, camera)
    assert any(np.array_equal(first, crop) for crop in mined["crops"])
    assert not any(np.array_equal(first, crop) for crop in plain["crops"])


@pytest.mark.parametrize(
    ("off", "wide", "expected"),
    [(0.1, 1.0, True), (0.5, 1.2, True), (1.0, 1.0, None), (0.1, 2.5, None), (2.5, 1.0, False)],
)
def test_a_view_shows_the_hand_if_it_is_near_and_of_its_size(
    off: float, wide: float, expected: bool | None
) -> None:
    maker = SOURCES["ours"].maker()
    frame = next(
        frame
        for number in range(20)
        if (frame := maker.make(np.random.default_rng([6, number]))).visible > 0.8
    )
    right = hand_view(frame.pose, maker.centre, maker.radius, 128)
    ray = right.rotation @ [wide * right.slope * off, 0.0, 1.0]
    view = looking_at(ray, wide * right.slope, 128)
    assert shows(view, frame, maker) is expected
    assert shows(view, frame._replace(visible=0.0), maker) is False


def test_files_that_are_there_are_kept(tmp_path: Path) -> None:
    source = SOURCES["stranger"]
    first = make_chunk(source, 3, tmp_path, 4)
    stamp = chunk_path(tmp_path, 3).stat().st_mtime_ns
    assert make_chunk(source, 3, tmp_path, 4) == first
    assert chunk_path(tmp_path, 3).stat().st_mtime_ns == stamp
    assert not list(tmp_path.glob("*.part*"))


def test_a_camera_changes_brightness_colour_and_noise() -> None:
    image = np.full((60, 80, 3), 120, dtype=np.uint8)
    developed = [develop(image, np.random.default_rng(number)) for number in range(40)]
    means = np.array([each.mean() for each in developed])
    assert means.std() > 10.0
    assert np.array_equal(developed[3], develop(image, np.random.default_rng(3)))


def test_a_hand_at_a_ball_joint_turns_within_its_range(tmp_path: Path) -> None:
    path = tmp_path / "ball.xml"
    path.write_text(
        """<mujoco><worldbody><camera name="eye" pos="0 0 1"/><body name="hand">
        <joint type="ball" range="0 40"/><geom type="box" size="0.04 0.03 0.01"/>
        </body></worldbody></mujoco>"""
    )
    maker = FrameMaker(load_model(path, np.random.default_rng(0)), "hand", "eye")
    start = np.diag([1.0, -1.0, -1.0])  # camera x right, y down, z forward
    angles = []
    for number in range(20):
        rotation = maker.make(np.random.default_rng(number)).pose[:3, :3] @ start.T
        angles.append(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)))
    assert max(angles) < np.deg2rad(40.0) + 1e-9
    assert max(angles) > np.deg2rad(20.0)
    assert len(set(np.round(angles, 6))) == 20


def test_a_camera_does_not_move_what_it_takes() -> None:
    """Labels would be wrong by as much as a blur shifts the picture."""
    image = np.zeros((61, 81, 3), dtype=np.uint8)
    image[20:41, 30:51] = 200
    for number in range(60):
        taken = develop(image, np.random.default_rng(number)).astype(float).sum(axis=2)
        rows, columns = np.nonzero(taken > 0.5 * (taken.min() + np.quantile(taken, 0.95)))
        assert abs(np.mean(rows) - 30.0) < 0.6
        assert abs(np.mean(columns) - 40.0) < 0.6


def test_a_hand_is_in_view_where_that_is_wanted_and_possible() -> None:
    maker = SOURCES["ours"].maker()
    for number in range(12):
        frame = maker.make(np.random.default_rng([7, number]), shown=number % 2 == 0)
        x, y, z = frame.middle(maker.centre)
        within = z > 0.0 and abs(x) * maker.focal < 320 * z and abs(y) * maker.focal < 240 * z
        assert within == (number % 2 == 0)


def test_a_part_of_a_hand_at_the_border_has_a_share() -> None:
    maker, without = SOURCES["ours"].maker(), maker_without_hand(SOURCES["ours"])
    seen = 0
    for number in range(60):
        frame = maker.make(np.random.default_rng([8, number]), shown=False)
        other = without.make(np.random.default_rng([8, number]), shown=False)
        if np.mean(np.abs(frame.image.astype(int) - other.image).max(axis=2) > 30) > 0.01:
            seen += 1
            assert frame.visible > 0.0
    assert seen > 0


def test_a_hand_that_cannot_leave_the_view_is_left_out() -> None:
    source = SOURCES["stranger"]
    maker, without = source.maker(), maker_without_hand(source)
    for number in range(5):
        frame = maker.make(np.random.default_rng([8, number]), shown=False)
        other = without.make(np.random.default_rng([8, number]), shown=False)
        assert frame.visible == 0.0
        assert np.array_equal(frame.image, other.image)


def test_the_other_geoms_are_those_that_are_not_the_hands() -> None:
    source = SOURCES["stranger"]
    maker = source.maker()
    model = load_model(source.model, np.random.default_rng([source.seed, 1]), source.hidden)
    hand = hand_geoms(model, model.body(source.body).id)
    frame = maker.make(np.random.default_rng(7))
    assert len(frame.others) == model.ngeom - len(hand)
