"""Patterns of surfaces: skins of robots, tables, walls, a screen, things printed on paper.

Each is an image (side, side, 3) of floats, about 0 to 1, made by NumPy and OpenCV from a random
generator.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from jmm_agent.types import Floats

Random = np.random.Generator
Colour = tuple[float, float, float]
Pattern = Callable[[Random, int, Floats], Floats]
"""(generator, side [px], colour (3,)) -> image."""


def uneven(rng: Random, side: int, coarsest: int, octaves: int = 4) -> Floats:
    """Smooth random values (side, side) of mean 0 and standard deviation 1.

    Args:
        rng: chooses them.
        side: of the image [px].
        coarsest: number of cells along a side of the coarsest octave.
        octaves: number of octaves; each has half the amplitude of the one before.
    """
    total = np.zeros((side, side))
    for octave in range(octaves):
        cells = min(coarsest * 2**octave, side)
        grid = rng.standard_normal((cells + 1, cells + 1)).astype(np.float32)
        total += 0.5**octave * cv2.resize(grid, (side, side), interpolation=cv2.INTER_CUBIC)
    return np.asarray((total - total.mean()) / max(total.std(), 1e-9))


def _tinted(values: Floats, colour: Floats) -> Floats:
    """A colour whose brightness is multiplied by values (side, side)."""
    return np.clip(values[:, :, None] * colour, 0.0, 1.0)


def plain(rng: Random, side: int, colour: Floats) -> Floats:
    """A painted surface, slightly uneven and soiled."""
    soiled = 1.0 + rng.uniform(0.0, 0.06) * uneven(rng, side, 3)
    return _tinted(soiled, colour)


def brushed(rng: Random, side: int, colour: Floats) -> Floats:
    """Brushed metal: streaks along one direction."""
    streaks = rng.standard_normal((side, 1)) * 0.08 + rng.standard_normal((side, side)) * 0.03
    streaks = cv2.blur(streaks, (9, 1)) + 0.04 * uneven(rng, side, 2)
    image = _tinted(1.0 + streaks, colour)
    return image if rng.uniform() < 0.5 else image.transpose(1, 0, 2)


def layers(rng: Random, side: int, colour: Floats) -> Floats:
    """Layers of a 3D print."""
    period = rng.uniform(3.0, 7.0)
    lines = 0.10 * np.sin(2.0 * np.pi * np.arange(side) / period)[:, None]
    return _tinted(1.0 + lines + 0.03 * uneven(rng, side, 4), colour)


def weave(rng: Random, side: int, colour: Floats) -> Floats:
    """Woven carbon fibres."""
    cell = int(rng.integers(3, 7))
    rows, columns = np.mgrid[:side, :side] // cell
    twill = ((rows + columns) % 4 < 2).astype(float)
    return _tinted(0.6 + 1.0 * twill + 0.1 * uneven(rng, side, 4), colour)


def scratched(rng: Random, side: int, colour: Floats) -> Floats:
    """Used metal or paint with scratches and bright edges."""
    image = plain(rng, side, colour)
    for _ in range(int(rng.integers(4, 16))):
        ends = rng.integers(0, side, 4).tolist()
        bright = np.clip(colour + rng.uniform(-0.25, 0.35), 0.0, 1.0).tolist()
        cv2.line(image, tuple(ends[:2]), tuple(ends[2:]), bright, 1, cv2.LINE_AA)
    return image


def wood(rng: Random, side: int, colour: Floats) -> Floats:
    """Boards of wood with a grain."""
    columns = np.linspace(0.0, rng.uniform(6.0, 20.0), side)[None, :]
    bent = columns + 0.5 * uneven(rng, side, 2, 3)
    grain = 0.10 * np.sin(2.0 * np.pi * bent) + 0.05 * rng.standard_normal((1, side))
    image = _tinted(1.0 + grain + 0.05 * uneven(rng, side, 3), colour)
    if rng.uniform() < 0.5:
        image[:: side // int(rng.integers(2, 5))] *= 0.5  # gaps between boards
    return image if rng.uniform() < 0.5 else image.transpose(1, 0, 2)


def grid(rng: Random, side: int, colour: Floats) -> Floats:
    """A cutting mat, tiles or squared paper."""
    image = plain(rng, side, colour)
    step = int(rng.integers(side // 16, side // 3))
    line = np.clip(colour + rng.choice([-0.3, 0.3, 0.5]), 0.0, 1.0)
    for first in range(0, side, step):
        image[first : first + 2] = line
        image[:, first : first + 2] = line
    return image


def rough(rng: Random, side: int, colour: Floats) -> Floats:
    """Concrete, felt or a carpet."""
    grains = rng.uniform(0.03, 0.12) * rng.standard_normal((side, side))
    return _tinted(1.0 + grains + rng.uniform(0.03, 0.15) * uneven(rng, side, 4), colour)


def printed(rng: Random, side: int, colour: Floats) -> Floats:
    """Paper or a package with lines of text, pictures and codes."""
    image = plain(rng, side, colour)
    ink = np.clip(colour - rng.uniform(0.4, 0.9), 0.0, 1.0)
    row = int(side * rng.uniform(0.03, 0.15))
    while row < side - 8:
        height = int(rng.integers(2, 7))
        column = int(side * 0.06)
        while column < side * rng.uniform(0.6, 0.95):
            width = int(rng.integers(2, 14))
            image[row : row + height, column : column + width] = ink
            column += width + int(rng.integers(2, 5))
        row += height + int(rng.integers(3, 10))
    for _ in range(int(rng.integers(0, 3))):
        left, top = (int(value) for value in rng.integers(0, side * 3 // 4, 2))
        size = int(rng.integers(side // 8, side // 3))
        image[top : top + size, left : left + size] = rng.uniform(0.0, 1.0, 3)
    return image


def screen(rng: Random, side: int, colour: Floats) -> Floats:
    """A screen with windows: code on dark, a plot on white."""
    image = np.ones((side, side, 3)) * colour
    for _ in range(int(rng.integers(2, 6))):
        left, top = (int(value) for value in rng.integers(0, side * 3 // 4, 2))
        width, height = (int(value) for value in rng.integers(side // 5, side, 2))
        part = image[top : top + height, left : left + width]
        part[:] = rng.choice([0.08, 0.95]) * np.ones(3)
        for row in range(6, part.shape[0] - 3, 7):
            end = int(rng.integers(1, max(part.shape[1], 2)))
            part[row : row + 3, 4:end] = rng.uniform(0.0, 1.0, 3)
        part[:5] = rng.uniform(0.2, 0.8, 3)
    return image


def room(rng: Random, side: int, colour: Floats) -> Floats:
    """A wall with what stands before it or hangs on it: shelves, posters, windows, doors."""
    image = plain(rng, side, colour)
    for _ in range(int(rng.integers(1, 6))):
        left, top = (int(value) for value in rng.integers(0, side * 3 // 4, 2))
        width, height = (int(value) for value in rng.integers(side // 10, side // 2, 2))
        part = image[top : top + height, left : left + width]
        kind = rng.choice(["window", "poster", "rack", "door"])
        if kind == "window":
            part[:] = rng.uniform(0.85, 1.0) * np.array([0.95, 0.98, 1.0])
            part[:, :: max(width // 3, 4)] = rng.uniform(0.2, 0.9)
        elif kind == "poster":
            whole = printed(rng, side, rng.uniform(0.6, 1.0, 3))
            part[:] = whole[: part.shape[0], : part.shape[1]]
        elif kind == "rack":
            _fill_rack(rng, part)
        else:
            part[:] = rng.uniform(0.1, 0.8, 3)
    return image


def _fill_rack(rng: Random, part: Floats) -> None:
    """Books and boxes in a bookcase."""
    part[:] = rng.uniform(0.1, 0.6)
    board = max(part.shape[0] // int(rng.integers(2, 5)), 6)
    for row in range(0, part.shape[0], board):
        column = 0
        while column < part.shape[1]:
            width = int(rng.integers(3, 12))
            top = row + int(rng.integers(1, max(board // 2, 2)))
            part[top : row + board - 2, column : column + width] = rng.uniform(0.05, 0.95, 3)
            column += width + int(rng.integers(0, 4))
