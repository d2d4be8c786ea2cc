"""Tests of the networks of the hand detector and their training."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from kengoro.hand_detector.networks import augmentation
from kengoro.hand_detector.networks.finder import FinderNetwork, finder_loss
from kengoro.hand_detector.networks.points import PointsNetwork, points_loss
from kengoro.hand_detector.networks.start import start_from
from kengoro.hand_detector.networks.training import Examples, Job, export, train

pytestmark = pytest.mark.torch

COUNT, SIZE = 4, 32


def write_squares(folder: Path, count: int = 200) -> None:
    """Examples of a white square whose corners are the points; some crops have none."""
    random = np.random.default_rng(0)
    crops = random.integers(0, 60, (count, SIZE, SIZE, 3), dtype=np.uint8)
    positions, present = np.zeros((count, COUNT, 2), np.float32), np.zeros(count, np.float32)
    small = random.integers(0, 60, (count, 32, 48, 3), dtype=np.uint8)
    cells = np.zeros((count, 4), np.float32)
    for number in range(count):
        if number % 5 == 0:
            continue
        side, (x, y) = random.integers(6, 12), random.integers(3, 18, 2)
        crops[number, y : y + side, x : x + side] = 230
        right, below = x + side - 1, y + side - 1
        corners = np.array([[x, y], [right, y], [x, below], [right, below]])
        positions[number] = (corners - (SIZE - 1) / 2) / (SIZE / 2)
        present[number] = 1.0
        column, row = random.integers(8, 38), random.integers(8, 24)
        cv2.circle(small[number], (int(column), int(row)), 5, (240, 240, 240), -1)
        cells[number] = (column + 0.5) / 8 - 0.5, (row + 0.5) / 8 - 0.5, np.log(0.3), 1.0
    np.savez(folder / "examples_00000.npz", crops=crops, positions=positions, present=present,
             small=small, cells=cells)  # fmt: skip


@pytest.fixture
def job(tmp_path: Path) -> Job:
    write_squares(tmp_path)
    return Job(str(tmp_path), "points", 64 * 16, SIZE, COUNT, threads=1)


def test_parts_of_crops_are_hidden_and_frames_are_moved_but_not_hidden(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rectangle may hide a whole hand of a frame, whose label would then be wrong."""
    count = 100
    cells = np.tile(np.array([2.0, 1.0, -1.0, 1.0], np.float32), (count, 1))
    np.savez(
        tmp_path / "examples_00000.npz", small=np.full((count, 32, 48, 3), 99, np.uint8),
        cells=cells, crops=np.full((count, SIZE, SIZE, 3), 99, np.uint8),
        positions=np.zeros((count, COUNT, 2), np.float32), present=np.ones(count, np.float32),
    )  # fmt: skip
    points = Job(str(tmp_path), "points", 64, SIZE, COUNT)
    crops, *_ = Examples(points).batch(np.random.default_rng(0))
    uneven = [float(np.ptp(crop.numpy(), axis=(1, 2)).max()) > 1e-3 for crop in crops]
    assert 0.15 < np.mean(uneven) < 0.45
    _, moved = Examples(replace(points, kind="finder")).batch(np.random.default_rng(0))
    assert 0.5 < np.mean((np.abs(moved.numpy() - cells[0]) > 1e-3).any(axis=1)) < 0.9
    monkeypatch.setattr(augmentation, "MOVED", 0.0)
    frames, _ = Examples(replace(points, kind="finder")).batch(np.random.default_rng(0))
    assert max(float(np.ptp(frame.numpy(), axis=(1, 2)).max()) for frame in frames) < 1e-3


def test_training_finds_the_points_and_their_absence(job: Job) -> None:
    network = train(replace(job, samples=64 * 80)).eval()
    with np.load(Path(job.folder) / "examples_00000.npz") as stored:
        crops, positions, present = (stored[name] for name in ("crops", "positions", "present"))
    with torch.no_grad():
        output = network(torch.from_numpy(crops).permute(0, 3, 1, 2).float() / 255.0).numpy()
    there = present == 1.0
    away = np.abs(output[:, : 2 * COUNT].reshape(-1, COUNT, 2) - positions)[there]
    assert np.median(away) < 0.08  # of half a crop of 32 px: 1.3 px
    assert np.mean((output[:, -1] > 0.0) == there) > 0.95
    spread = np.exp(-output[there][:, 2 * COUNT : 5 * COUNT].reshape(-1, COUNT, 3)[..., :2])
    assert 0.3 < np.median(away) / np.median(spread) < 3.0  # it knows how far it is off


def test_a_training_that_was_stopped_ends_with_the_same_weights(
    job: Job, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = train(job).state_dict()
    (tmp_path / "points.checkpoint").unlink()
    monkeypatch.setattr("kengoro.hand_detector.networks.training.CHECKPOINT", 0.0)
    saves = []

    def stop(*_: object) -> None:
        saves.append(0)
        if len(saves) == 8:
            raise KeyboardInterrupt

    monkeypatch.setattr("kengoro.hand_detector.networks.training._report", stop)
    with pytest.raises(KeyboardInterrupt):
        train(job)
    assert (tmp_path / "points.checkpoint").exists()
    monkeypatch.setattr("kengoro.hand_detector.networks.training._report", lambda *_: None)
    resumed = train(job).state_dict()
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)


@pytest.mark.parametrize("kind", ["points", "finder"])
def test_an_exported_network_has_the_same_outputs(job: Job, tmp_path: Path, kind: str) -> None:
    torch.manual_seed(3)
    network = FinderNetwork() if kind == "finder" else PointsNetwork(COUNT, SIZE)
    path = tmp_path / f"{kind}.onnx"
    export(network, replace(job, kind=kind), path)
    there = cv2.dnn.readNetFromONNX(np.frombuffer(path.read_bytes(), np.uint8))
    for shape in [(32, 32)] if kind == "points" else [(128, 160), (96, 112)]:
        picture = np.random.default_rng(1).random((1, 3, *shape), dtype=np.float32)
        there.setInput(picture)
        with torch.no_grad():
            expected = network(torch.from_numpy(picture)).numpy()
        assert there.forward() == pytest.approx(expected, abs=1e-4)


def test_an_exported_network_names_no_folder_of_the_machine(job: Job, tmp_path: Path) -> None:
    export(PointsNetwork(COUNT, SIZE), job, tmp_path / "points.onnx")
    content = (tmp_path / "points.onnx").read_bytes()
    for trace in (
        b'File "',
        b"networks/points",
        str(Path(__file__).parents[3]).encode(),
        b"site-packages",
    ):
        assert trace not in content


@pytest.mark.parametrize("kind", ["points", "finder"])
def test_a_network_that_starts_from_an_exported_one_computes_the_same(
    job: Job, tmp_path: Path, kind: str
) -> None:
    trained, path = train(replace(job, kind=kind)), tmp_path / "trained.onnx"
    export(trained, job if kind == "points" else replace(job, kind=kind), path)
    torch.manual_seed(5)
    network = FinderNetwork() if kind == "finder" else PointsNetwork(COUNT, SIZE)
    pictures = torch.rand(16, 3, SIZE, SIZE)
    taken, count = start_from(network, path, pictures)
    assert taken == count
    others = torch.rand(7, 3, SIZE, SIZE)
    with torch.no_grad():
        assert network.eval()(others).numpy() == pytest.approx(trained(others).numpy(), abs=1e-3)


def test_a_training_from_trained_weights_begins_where_that_one_ended(
    job: Job, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, steps = tmp_path / "trained.onnx", 16

    def first_loss(of: Job) -> float:
        (tmp_path / "points.checkpoint").unlink(missing_ok=True)
        train(of)
        return float(json.loads(capsys.readouterr().out.splitlines()[0])["curve"][-1][2])

    afresh = first_loss(replace(job, samples=64 * steps))
    export(train(replace(job, samples=64 * 5 * steps)), job, path)
    assert first_loss(replace(job, samples=64 * steps, start=str(path))) < afresh - 1.0


def test_weights_of_another_count_of_points_fit_in_part_and_foreign_ones_not(
    job: Job, tmp_path: Path
) -> None:
    pictures = torch.rand(4, 3, SIZE, SIZE)
    for kind, network in (("points", PointsNetwork(COUNT + 3, SIZE)), ("finder", FinderNetwork())):
        export(network, replace(job, kind=kind), tmp_path / f"{kind}.onnx")
    here = PointsNetwork(COUNT, SIZE)
    taken, count = start_from(here, tmp_path / "points.onnx", pictures)
    assert 0 < taken < count
    with pytest.raises(ValueError, match=r"no weights of finder\.onnx fit"):
        start_from(here, tmp_path / "finder.onnx", pictures)


def test_the_loss_is_least_at_the_points_and_rises_with_false_confidence() -> None:
    positions, present = torch.zeros(1, COUNT, 2), torch.ones(1)

    def loss(error: float, spread: float) -> float:
        output = torch.zeros(1, 5 * COUNT + 1)
        output[:, : 2 * COUNT] = error
        output[:, 2 * COUNT : 5 * COUNT : 3] = output[:, 2 * COUNT + 1 : 5 * COUNT : 3] = spread
        return float(points_loss(output, positions, present))

    assert loss(0.0, 2.0) < loss(0.05, 2.0) < loss(0.2, 2.0)
    assert loss(0.2, 5.0) > loss(0.2, 2.0)
    assert loss(0.001, 5.0) < loss(0.001, 2.0)


def test_the_loss_of_the_finder_is_least_for_the_right_cell() -> None:
    cells = torch.tensor([[3.25, 1.5, -1.0, 1.0]])

    def loss(column: int, row: int, there: float = 1.0) -> float:
        output = torch.zeros(1, 4, 4, 6)
        output[:, 0] = -8.0
        output[:, 0, row, column] = 3.0
        rows, columns = torch.meshgrid(torch.arange(4.0), torch.arange(6.0), indexing="ij")
        output[:, 1], output[:, 2], output[:, 3] = 3.25 - columns, 1.5 - rows, -1.0
        return float(finder_loss(output, cells * torch.tensor([1.0, 1.0, 1.0, there])))

    assert loss(3, 1) < loss(5, 3)
    assert loss(3, 1, there=0.0) > 2.0
