"""Markers in bad conditions: found and pose errors, beside OpenCV's SUBPIX and APRILTAG.

Synthetic markers before photograph-like backgrounds, or before photographs of your own
(`python -m benchmarks.markers --backgrounds FOLDER`). All detectors have the same intrinsics and
the same pose from corners (IPPE, then Levenberg-Marquardt); none is told where the marker is.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks._marker_frames import SIDE, Condition, Floats, render
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerDetector
from jmm_agent.vision.marker_view import MarkerView
from jmm_agent.vision.square_pose import angle_between, solve_square, square_corners

VGA = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)
BARREL = Camera(640, 480, 580.0, 580.0, 319.5, 239.5, (-0.3, 0.0, 0.0, 0.0))
WIDE = (-0.32, 0.11, 0.001, -0.001, 0.02, 0.05, 0.01, 0.002)
RATIONAL = Camera(640, 480, 500.0, 500.0, 319.5, 239.5, WIDE, "rational_polynomial")
FISHEYE = Camera(640, 480, 250.0, 250.0, 320.0, 240.0, (0.05, -0.01, 0.0, 0.0), "fisheye")
CONDITIONS = (
    Condition("60 to 140 px", VGA),
    Condition("40 to 60 px", VGA, size=(40.0, 60.0)),
    Condition("18 to 24 px", VGA, size=(18.0, 24.0)),
    Condition("motion blur 9 px", VGA, motion=9.0),
    Condition("defocus 4 px", VGA, defocus=4.0),
    Condition("light x 0.06", VGA, light=0.06, noise=1.0),
    Condition("noise 12 of 255", VGA, noise=12.0),
    Condition("hidden corner", VGA, hidden=0.15),
    Condition("gloss", VGA, gloss=True),
    Condition("fx 580, fy 560, off centre", Camera(640, 480, 580.0, 560.0, 344.5, 222.5)),
    Condition("k1 = -0.3", BARREL),
    Condition("rational lens", RATIONAL),
    Condition("fisheye", FISHEYE, size=(40.0, 90.0)),
    Condition("DICT_5X5_100", VGA, dictionary="DICT_5X5_100"),
    Condition("DICT_APRILTAG_36h11", VGA, dictionary="DICT_APRILTAG_36h11"),
    Condition("border of two cells", VGA, border=2),
    Condition("4K, 250 to 400 px", Camera(3840, 2160, 3e3, 3e3, 1919.5, 1079.5), (250.0, 400.0)),
    Condition("12 MP, 60 to 300 px", Camera(4000, 3000, 3e3, 3e3, 1999.5, 1499.5), (60.0, 300.0)),
)
OURS, SUBPIX, APRILTAG = "ours", "SUBPIX", "APRILTAG"
OTHERS = {SUBPIX: cv2.aruco.CORNER_REFINE_SUBPIX, APRILTAG: cv2.aruco.CORNER_REFINE_APRILTAG}
FLIP_DEG = 1.0
"""A pose is flipped if the other solution is more exact by this."""
IDS = 30
"""Ids are sampled below this number."""
LARGE_SHARE = 4
"""Of frames over a megapixel, one in this number is rendered."""
HALF, EQUAL, UNSURE = 0.5, 1.05, 0.02
"""Largest ratio of pose errors in the median over conditions, and in each; largest share of poses
that are called ambiguous, which are no flips, but count with all of their errors."""


@dataclass
class Tally:
    """Errors of one detector in one condition, a value a frame; NaN where nothing was found.

    Attributes:
        mm: errors of the position [mm].
        deg: errors of the orientation [deg].
        flipped: whether the flipped pose is the more exact one.
        unsure: whether the detector calls the pose ambiguous.
        seconds: CPU time of each frame [s].
    """

    mm: list[float] = field(default_factory=list)
    deg: list[float] = field(default_factory=list)
    flipped: list[bool] = field(default_factory=list)
    unsure: list[bool] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(
        self, pose: Floats | None, flipped: Floats | None, true: Floats, unsure: bool, took: float
    ) -> None:
        """Add the result of a frame.

        Args:
            pose: pose_marker_in_camera (4, 4); None if the marker was not found.
            flipped: the second solution (4, 4).
            true: the true pose (4, 4).
            unsure: whether the detector calls the pose ambiguous.
            took: CPU time [s].
        """
        mm, deg = (np.nan, np.nan) if pose is None else pose_error(pose, true)
        other = np.nan if flipped is None else pose_error(flipped, true)[1]
        self.mm.append(mm)
        self.deg.append(deg)
        self.flipped.append(bool(deg > other + FLIP_DEG))
        self.unsure.append(unsure)
        self.seconds.append(took)

    @property
    def found(self) -> int:
        """Number of frames with a pose."""
        return int(np.isfinite(self.mm).sum())


def pose_error(pose: Floats, true: Floats) -> tuple[float, float]:
    """Distance [mm] and angle [deg] between two poses (4, 4)."""
    distance = 1e3 * float(np.linalg.norm(pose[:3, 3] - true[:3, 3]))
    return distance, float(np.degrees(angle_between(pose, true)))


def stock_pose(
    detector: cv2.aruco.ArucoDetector, image: np.ndarray, marker: int, camera: Camera
) -> tuple[Floats, Floats] | None:
    """The marker's pose and the flipped one (4, 4) by OpenCV's detector; None if it has none."""
    quads, ids, _ = detector.detectMarkers(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
    found = (
        []
        if ids is None
        else [q[0] for q, i in zip(quads, ids.ravel(), strict=True) if i == marker]
    )
    if not found:
        return None
    view = MarkerView(camera, found[0].astype(float))
    corners = view.view_px(found[0].astype(float))
    if not np.isfinite(corners).all():
        return None
    solved = solve_square(square_corners(SIDE), corners, view.matrix)
    return solved and (view.in_camera(solved.pose), view.in_camera(solved.flipped))


def stock_detector(condition: Condition, refinement: int) -> cv2.aruco.ArucoDetector:
    """OpenCV's detector with its default settings, and a refinement of the corners."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = refinement
    parameters.markerBorderBits = condition.border
    number = getattr(cv2.aruco, condition.dictionary)
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(number), parameters)


def measure(
    condition: Condition, seeds: Sequence[int], photographs: list[Path] | None
) -> dict[str, Tally]:
    """Errors of all detectors in one condition.

    Args:
        condition: what the marker looks like.
        seeds: one a frame.
        photographs: backgrounds; made by code if None.
    """
    stock = {name: stock_detector(condition, method) for name, method in OTHERS.items()}
    tallies = {name: Tally() for name in (OURS, *OTHERS)}
    for seed in track(seeds, condition.name, console=Console(stderr=True), transient=True):
        rng = np.random.default_rng(seed)
        marker = int(rng.integers(IDS))
        image, true = render(condition, marker, rng, photographs)
        camera = condition.camera
        ours = MarkerDetector(camera, {marker: SIDE}, condition.dictionary, condition.border)
        start = time.process_time()
        seen = ours.detect(image).poses.get(marker)
        took = time.process_time() - start
        pose: Floats | None = None
        flipped: Floats | None = None
        if seen is not None:
            pose, flipped = seen.pose_marker_in_camera, seen.flipped_in_camera
        unsure = seen is not None and seen.ambiguous
        tallies[OURS].add(pose, flipped, true, unsure, took)
        for name, detector in stock.items():
            start = time.process_time()
            pose, flipped = stock_pose(detector, image, marker, camera) or (None, None)
            tallies[name].add(pose, flipped, true, False, time.process_time() - start)
    return tallies


def ratios(tallies: dict[str, Tally]) -> dict[str, float]:
    """Our median error of position and rotation, divided by that of the better other detector.

    Each pair is compared on the frames in which both found the marker; NaN if there are none.
    """
    found = {}
    for part in ("mm", "deg"):
        pairs = []
        for name in OTHERS:
            ours, other = (np.array(getattr(tallies[n], part)) for n in (OURS, name))
            both = np.isfinite(ours) & np.isfinite(other)
            if both.any():
                pairs.append(float(np.median(ours[both]) / np.median(other[both])))
        found[part] = max(pairs, default=float("nan"))
    return found


def conclude(results: dict[str, dict[str, Tally]]) -> dict[str, dict[str, Any]]:
    """What must be reached, and whether it is, by name.

    Args:
        results: tallies by condition and detector.
    """
    missing = {
        name: max(t[other].found for other in OTHERS) - t[OURS].found for name, t in results.items()
    }
    compared = {name: ratios(t) for name, t in results.items()}
    ours = [t[OURS] for t in results.values()]
    flips, unsure = [f for t in ours for f in t.flipped], [u for t in ours for u in t.unsure]
    sure = sum(flip and not doubt for flip, doubt in zip(flips, unsure, strict=True))
    share = sum(unsure) / max(1, sum(t.found for t in ours))

    def metric(value: float, must: str, reached: bool, **more: object) -> dict[str, Any]:
        return {"value": value, "must": must, "reached": bool(reached), **more}

    metrics = {
        "markers_fewer_than_opencv": metric(
            max(missing.values()), "at most 0", max(missing.values()) <= 0
        )
    }
    for part, title in (("mm", "position"), ("deg", "rotation")):
        values = {n: r[part] for n, r in compared.items() if np.isfinite(r[part])}
        middle, worst = float(np.median(list(values.values()))), max(values, key=values.__getitem__)
        metrics[f"{title}_error_ratio_median"] = metric(middle, f"at most {HALF}", middle <= HALF)
        metrics[f"{title}_error_ratio_worst"] = metric(
            values[worst], f"at most {EQUAL}", values[worst] <= EQUAL, condition=worst
        )
    metrics["flips"] = metric(sure, "0", sure == 0, with_ambiguous=sum(flips))
    metrics["ambiguous_share"] = metric(share, f"at most {UNSURE}", share <= UNSURE)
    return metrics


def report(results: dict[str, dict[str, Tally]], metrics: dict[str, dict[str, Any]]) -> None:
    """Print the tables."""
    table = Table(title="Found; median errors over all found: mm / deg; CPU time of a frame [ms]")
    table.add_column("condition", no_wrap=True)
    for name in (OURS, *OTHERS):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("error ratio mm / deg", justify="right")
    for condition, tallies in results.items():
        cells = []
        for tally in tallies.values():
            mm, deg = (
                np.nanmedian([*e, np.inf][: None if not tally.found else -1])
                for e in (tally.mm, tally.deg)
            )
            took = 1e3 * float(np.median(tally.seconds))
            cells.append(f"{tally.found}/{len(tally.mm)}  {mm:.3f} / {deg:.3f}  {took:.0f}")
        ratio = ratios(tallies)
        table.add_row(condition, *cells, f"{ratio['mm']:.2f} / {ratio['deg']:.2f}")
    console = Console(width=140)
    console.print(table)
    for name, found in metrics.items():
        state = "reached" if found["reached"] else "NOT REACHED"
        more = [f"{key} {found[key]}" for key in ("condition", "with_ambiguous") if key in found]
        where = f" ({more[0]})" if more else ""
        console.print(f"{name}: {found['value']:.3g}{where}; must be {found['must']}: {state}")


def main(
    frames: int = 40,
    first: int = 100,
    backgrounds: Path | None = None,
    out: Path = Path("out/markers"),
) -> None:
    """Print the table and the summary, and write ``summary.json``.

    Args:
        frames: number of frames of each condition.
        first: first seed; those below 100 are for tuning.
        backgrounds: folder of photographs; backgrounds are made by code if left out.
        out: folder of the summary.
    """
    cv2.setNumThreads(1)
    photographs = None
    if backgrounds is not None:
        photographs = sorted(
            p for p in backgrounds.iterdir() if p.suffix.lower() in (".jpg", ".jpeg", ".png")
        )
        if not photographs:
            raise SystemExit(f"There is no .jpg or .png in {backgrounds}.")
    results = {}
    for condition in CONDITIONS:
        large = condition.camera.width * condition.camera.height > 1_000_000
        count = max(1, frames // LARGE_SHARE) if large else frames
        results[condition.name] = measure(condition, range(first, first + count), photographs)
    metrics = conclude(results)
    report(results, metrics)
    out.mkdir(parents=True, exist_ok=True)
    summary = {"frames": frames, "first_seed": first, "metrics": metrics}
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=40, help="frames of each condition")
    parser.add_argument("--first", type=int, default=100, help="first seed; below 100 for tuning")
    parser.add_argument("--backgrounds", type=Path, help="folder of photographs (.jpg, .png)")
    parser.add_argument("--out", type=Path, default=Path("out/markers"))
    main(**vars(parser.parse_args()))
