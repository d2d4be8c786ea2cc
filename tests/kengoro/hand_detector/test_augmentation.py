"""Tests of the variations that a training makes of its examples."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch

from kengoro.hand_detector.networks import augmentation
from kengoro.hand_detector.networks.augmentation import hide_parts, move_frames, vary_colours

pytestmark = pytest.mark.torch

COUNT, HEIGHT, WIDTH = 64, 128, 160
LOG_SLOPE = -1.3


def discs() -> tuple[torch.Tensor, torch.Tensor]:
    """Black frames with a white disc each, and the labels for it; every fourth has none."""
    random = np.random.default_rng(0)
    frames, cells = np.zeros((COUNT, HEIGHT, WIDTH), np.float32), np.zeros((COUNT, 4), np.float32)
    for number in range(COUNT):
        if number % 4 == 0:
            continue
        column, row = random.uniform([40, 40], [WIDTH - 40, HEIGHT - 40]).astype(int)
        cv2.circle(frames[number], (int(column), int(row)), 10, 1.0, -1)
        cells[number] = (column + 0.5) / 8 - 0.5, (row + 0.5) / 8 - 0.5, LOG_SLOPE, 1.0
    return torch.from_numpy(frames)[:, None].repeat(1, 3, 1, 1), torch.from_numpy(cells)


def test_labels_follow_a_frame_that_is_moved() -> None:
    frames, cells = discs()
    moved, labels = move_frames(frames, cells, np.random.default_rng(1))
    compared, unmoved = 0, 0
    for before, frame, label, cell in zip(
        frames, moved, labels.numpy(), cells.numpy(), strict=True
    ):
        if cell[3] == 0.0:
            assert np.array_equal(label, cell)
            continue
        assert 0.0 <= (label[0] + 0.5) * 8 <= WIDTH
        assert 0.0 <= (label[1] + 0.5) * 8 <= HEIGHT
        rows, columns = np.nonzero(frame[0].numpy() > 0.5)
        touches = min(rows.min(), columns.min()) == 0 or columns.max() == WIDTH - 1
        if touches or rows.max() == HEIGHT - 1:  # a part of the disc has left the frame
            continue
        compared += 1
        unmoved += bool(torch.allclose(frame, before, atol=1e-3))
        pixel = (label[:2] + 0.5) * 8 - 0.5
        assert pixel == pytest.approx([columns.mean(), rows.mean()], abs=0.5)
        zoom = np.exp(label[2] - LOG_SLOPE)
        assert np.sqrt(len(rows) / np.pi) == pytest.approx(10.3 * zoom, rel=0.06)
    assert compared > 25
    assert 3 < unmoved < compared / 2


def test_a_turned_frame_is_the_given_one_seen_differently() -> None:
    """A bar along x becomes one that is turned, not one that is sheared or stretched."""
    frames = torch.zeros(COUNT, 3, HEIGHT, WIDTH)
    frames[:, :, 60:68, 50:110] = 1.0
    cells = torch.tensor([[(79.5 + 0.5) / 8 - 0.5, 7.5, LOG_SLOPE, 1.0]]).repeat(COUNT, 1)
    moved, labels = move_frames(frames, cells, np.random.default_rng(2))
    turns = []
    for frame, label in zip(moved, labels.numpy(), strict=True):
        rows, columns = np.nonzero(frame[0].numpy() > 0.5)
        touches = min(rows.min(), columns.min()) == 0 or columns.max() == WIDTH - 1
        if touches or rows.max() == HEIGHT - 1:
            continue
        spread = np.linalg.eigvalsh(np.cov(columns, rows))
        zoom = np.exp(label[2] - LOG_SLOPE)
        assert np.sqrt(12 * spread) == pytest.approx(np.array([8.0, 60.0]) * zoom, rel=0.12)
        turns.append(
            np.degrees(
                0.5
                * np.arctan2(
                    2 * np.cov(columns, rows)[0, 1], np.subtract(*np.diag(np.cov(columns, rows)))
                )
            )
        )
    assert len(turns) > 20
    assert np.ptp(turns) > 15.0


def test_some_frames_are_mirrored() -> None:
    """Three spots, one in each colour, go round the other way in them."""
    frames = np.zeros((COUNT, 3, HEIGHT, WIDTH), np.float32)
    for plane, (column, row) in enumerate([(70, 55), (95, 55), (70, 75)]):
        frames[:, plane, row - 3 : row + 4, column - 3 : column + 4] = 1.0
    cells = torch.tensor([[9.0, 7.0, LOG_SLOPE, 1.0]]).repeat(COUNT, 1)
    moved, _ = move_frames(torch.from_numpy(frames), cells, np.random.default_rng(6))
    signs = []
    for frame in moved.numpy():
        if (frame.max(axis=(1, 2)) < 0.5).any():  # a spot is outside
            continue
        at = [np.mean(np.nonzero(plane > 0.5), axis=1)[::-1] for plane in frame]
        (a, b), (c, d) = at[1] - at[0], at[2] - at[0]
        signs.append(a * d - b * c > 0.0)
    assert len(signs) > 40
    assert 0.15 < np.mean(np.logical_not(signs)) < 0.55


def test_a_hidden_part_is_one_rectangle_of_one_colour() -> None:
    pictures = torch.full((400, 3, 40, 60), 2.0)  # a value that no colour has
    hidden = hide_parts(pictures, np.random.default_rng(3)).numpy()
    covered = (hidden != 2.0).all(axis=1)
    assert 0.2 < covered.any(axis=(1, 2)).mean() < 0.4
    for picture, mask in zip(hidden, covered, strict=True):
        rows, columns = mask.any(axis=1), mask.any(axis=0)
        assert np.array_equal(mask, rows[:, None] & columns)
        assert rows.sum() <= 0.4 * 40 + 1
        assert columns.sum() <= 0.4 * 60 + 1
        assert len(np.unique(picture[:, mask], axis=1).T) <= 1


def test_colours_are_exchanged_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(augmentation, "GAIN", 0.0)
    monkeypatch.setattr(augmentation, "BIAS", 0.0)
    pictures = torch.randint(0, 256, (300, 4, 5, 3), dtype=torch.uint8)
    given = pictures.permute(0, 3, 1, 2) / 255.0
    varied = vary_colours(pictures, np.random.default_rng(4))
    assert torch.allclose(varied.sort(dim=1).values, given.sort(dim=1).values)
    same = torch.isclose(varied, given).flatten(1).all(dim=1).numpy()
    assert 0.45 < same.mean() < 0.7
    for before, after in zip(given, varied, strict=True):  # a colour goes with all its pixels
        assert all(any(torch.allclose(plane, one) for one in before) for plane in after)


def test_the_same_seed_makes_the_same_variations() -> None:
    frames, cells = discs()
    one, other = (move_frames(frames, cells, np.random.default_rng(5)) for _ in range(2))
    assert all(torch.equal(a, b) for a, b in zip(one, other, strict=True))
