"""Figures of the hand detector: errors, calibration, and frames with what was found in them."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")

import cv2
import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure
from scipy.stats import chi2

from experiments.hand_detector.criteria import MUST
from experiments.hand_detector.frames import Frame, make_frame
from experiments.hand_detector.optics import Image
from experiments.hand_detector.scores import (
    EXPECTED,
    WITHOUT,
    Record,
    claims,
    empty,
    error,
    seen,
    with_hand,
)
from experiments.hand_detector.studio import Studio
from experiments.harness.report import Picture, plain_ticks, png
from jmm_agent.types import Floats

SHOWN, COLUMNS = 12, 4
"""Number of frames on a sheet, and of those in a row."""
GREEN, RED = (60, 230, 60), (255, 60, 60)
"""Colours of the truth and of what was found."""
STYLES = {WITHOUT: ("#3a6fb5", "without an expected pose"),
          EXPECTED: ("#c8452f", "with an expected pose, 100 mm and 10 deg off")}  # fmt: skip


def pictures(records: Sequence[Record]) -> list[Picture]:
    """All figures of the report."""
    found = [record for record in seen(records) if claims(record)]
    shown = []
    if found:
        note = "Frames with at least half of the hand visible. Dashed: median and 95th percentile "
        note += "of the must."
        shown.append(Picture("Errors", _png(_errors(seen(records))), note))
        note = "Share of errors within the region that holds a share by the claimed covariance. "
        note += "On the dashed line claims are right; above it they are too modest."
        shown.append(Picture("Calibration", _png(_calibration(with_hand(records))), note))
    return shown + sheets(records)


def sheets(records: Sequence[Record]) -> list[Picture]:
    """Sheets of the worst frames, of others at random, and of claims without a hand."""
    worst = sorted(seen(records), key=_badness)[-SHOWN:][::-1]
    rng = np.random.default_rng(0)
    usual = seen(records)
    chosen = rng.permutation(len(usual))[:SHOWN]
    groups = {
        "The worst frames": worst,
        "Frames at random": [usual[i] for i in chosen],
        "Claims without a hand": [r for r in empty(records) if claims(r)][:SHOWN],
    }
    note = "Green: the hand as it is. Red: as it was found."
    studio = Studio()
    try:
        return [
            Picture(title, _encoded(sheet(studio, own)), note)
            for title, own in groups.items()
            if own
        ]
    finally:
        studio.close()


def _badness(record: Record) -> float:
    """What orders the worst frames: not found is worse than any error."""
    if not claims(record):
        return float("inf")
    answer, must = record[WITHOUT], MUST
    position = answer["position_mm"] / must["position_95_mm"]["most"]
    return float(max(position, answer["rotation_deg"] / must["rotation_95_deg"]["most"]))


def sheet(studio: Studio, records: Sequence[Record]) -> Image:
    """One image of some frames, each made again from its seed."""
    tiles = [tile(studio, make_frame(studio, record["seed"]), record) for record in records]
    while len(tiles) % COLUMNS and len(tiles) > COLUMNS:
        tiles.append(np.zeros_like(tiles[0]))
    rows = [tiles[i : i + COLUMNS] for i in range(0, len(tiles), COLUMNS)]
    return np.vstack([np.hstack(row) for row in rows])


def tile(studio: Studio, frame: Frame, record: Record) -> Image:
    """A frame with the outlines of the hand as it is and as it was found."""
    image = frame.image.copy()
    if frame.visible.hand:
        outline(image, studio, frame, frame.truth, GREEN)
    answer, families = record[WITHOUT], record["families"]
    title = f"{record['seed']}: {answer['reason']}"
    if answer["claims"]:
        outline(image, studio, frame, np.array(answer["pose"]), RED)
        title = f"{record['seed']}: {answer['position_mm']:.0f} mm"
        title += f", {answer['rotation_deg']:.0f} deg" if frame.visible.hand else ""
    below = f"{families['skin']}, {families['light']}, {families['camera']}"
    for text, height in ((title, 22), (below, 470)):
        image[height - 19 : height + 8, : 13 * len(text)] //= 4
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(image, text, (6, height), font, 0.65, (255, 255, 255), 1, cv2.LINE_AA)
    return np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))


def outline(
    image: Image, studio: Studio, frame: Frame, pose: Floats, colour: tuple[int, int, int]
) -> None:
    """Draw the outlines of the hand's geoms at a pose (4, 4) in the camera."""
    for points in studio.hand_outlines():
        pixels = frame.camera.project(points @ pose[:3, :3].T + pose[:3, 3])
        if np.isfinite(pixels).all() and np.abs(pixels).max() < 1e4:
            hull = cv2.convexHull(pixels.astype(np.float32)).astype(np.int32)
            cv2.polylines(image, [hull], True, colour, 1, cv2.LINE_AA)


def _encoded(image: Image) -> bytes:
    return bytes(cv2.imencode(".png", np.ascontiguousarray(image[:, :, ::-1]))[1])


def _png(figure: Figure) -> bytes:
    data = png(figure)
    pyplot.close(figure)
    return data


def _errors(records: Sequence[Record]) -> Figure:
    figure, axes = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for ax, name, tail, unit in (
        (axes[0], "position_mm", "position_95_mm", "mm"),
        (axes[1], "rotation_deg", "rotation_95_deg", "deg"),
    ):
        for key, (colour, label) in STYLES.items():
            errors = np.array([error(r, name, key) for r in records if claims(r, key)], float)
            if len(errors):
                shares = 100.0 * np.arange(1, len(errors) + 1) / len(errors)
                ax.step(np.sort(np.maximum(errors, 1e-2)), shares, color=colour, label=label)
        for metric, level in ((name, 50.0), (tail, 95.0)):
            ax.plot([MUST[metric]["most"]] * 2, [0, level], "k--", lw=0.8)
            ax.plot(MUST[metric]["most"], level, "k.")
        ax.set(xscale="log", xlabel=f"{name.split('_')[0]} error [{unit}]", ylim=(0, 101))
        plain_ticks(ax.xaxis)
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("share of claims with a smaller error [%]")
    axes[0].legend(loc="lower right", fontsize=8)
    return figure


def _calibration(records: Sequence[Record]) -> Figure:
    figure, ax = pyplot.subplots(figsize=(5.2, 5), layout="constrained")
    ax.plot([0, 1], [0, 1], color="#999999", linestyle="--", label="calibrated")
    for key, (colour, label) in STYLES.items():
        squares = [r[key]["distance2"] for r in records if claims(r, key)]
        claimed = np.sort(chi2.cdf([np.inf if d is None else d for d in squares], 6))
        if len(claimed):
            ax.step(claimed, np.arange(1, len(claimed) + 1) / len(claimed), color=colour,
                    label=label, where="post")  # fmt: skip
    ax.plot([0.95, 0.95], [0.90, 0.98], "k", lw=3, label="must")
    ax.set(xlabel="share that the claimed region holds [1]", ylabel="share of errors within it [1]")
    ax.set(xlim=(0, 1), ylim=(0, 1.01))
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right", fontsize=8)
    return figure
