"""Figures of the Vision Updater: seen and estimated marker, errors over postures."""

from __future__ import annotations

import base64
from typing import Any

import cv2
import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.harness.experiment import Results
from experiments.harness.report import GROUP_COLOURS, Picture, png
from experiments.robots.conditions import ACTUAL, NOMINAL
from jmm_agent.types import Floats
from kengoro.robots import CAMERA, HAND, SIDES
from kengoro.session import Session
from kengoro.visits import group_joints, rmse_deg

SEEN, ESTIMATED = "#D55E00", "#0072B2"


def estimated_and_seen(session: Session) -> dict[str, Any]:
    """Newest frame with the corners of the marker, detected and at the estimated joint angles.

    Returns:
        ``frame``: JPEG in base64. ``estimated``, ``seen``: corners, shape (4, 2) [px]; ``seen`` is
        None without a detection.
    """
    agent, options = session.agent, session.agent.options
    session.wait(0.4)
    marker = agent.detect_markers(session.readings).get(HAND)
    pose = agent.kinematics.pose(
        options.marker_site, agent.joint_angles, relative_to=options.camera
    )
    frame = cv2.cvtColor(np.asarray(session.observation["frame"]), cv2.COLOR_RGB2BGR)
    jpeg = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, 80])[1]
    return {
        "frame": base64.b64encode(jpeg.tobytes()).decode("ascii"),
        "estimated": corners(pose).tolist(),
        "seen": None if marker is None else corners(marker.pose_marker_in_camera).tolist(),
    }


def corners(pose: Floats) -> Floats:
    """Corners of the hand's marker in the nominal camera, shape (4, 2) [px]."""
    half = SIDES[HAND] / 2
    square = np.array([[-half, half], [half, half], [half, -half], [-half, -half]])
    points = square @ pose[:3, :2].T + pose[:3, 3]
    pixels = points @ CAMERA.matrix.T
    return np.asarray(pixels[:, :2] / pixels[:, 2:])


def pictures(results: Results) -> list[Picture]:
    """Marker before and after on one robot; errors by group over time."""
    first, result = shown_robot(results)
    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4.4))
    for ax, when in zip(axes, ("before", "after"), strict=True):
        draw_marker(ax, result[ACTUAL][when])
        ax.set_title(f"{when} learning")
    axes[0].legend(loc="lower left", fontsize=9)
    figure.tight_layout()
    found = [
        Picture(
            f"The hand's marker in the robot's camera, seen and estimated, robot {first}",
            png(figure),
            "Seen: detected in the frame. Estimated: computed from map and muscle lengths. The "
            "posture is not learned from.",
        )
    ]
    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4), sharey=True)
    for ax, condition in zip(axes, (ACTUAL, NOMINAL), strict=True):
        draw_errors(ax, results, condition)
        ax.set_title("actual robots" if condition == ACTUAL else "robots without departures")
    axes[0].set_ylabel("RMSE_joint [deg]")
    axes[0].legend(fontsize=8)
    figure.tight_layout()
    found.append(
        Picture(
            "RMSE_joint over time, at each posture before learning from it",
            png(figure),
            "Solid: estimate - seen, as in the paper. Dotted: estimate - true, all joints. Medians "
            "over robots; band: quartiles for the shoulder.",
        )
    )
    pyplot.close("all")
    return found


def shown_robot(results: Results) -> tuple[int, dict[str, Any]]:
    """The first actual robot whose hand was in view before and after; the first if none was."""
    for seed, result in results.items():
        if result[ACTUAL]["before"]["seen"] and result[ACTUAL]["after"]["seen"]:
            return seed, result
    return next(iter(results.items()))


def draw_marker(axes: Axes, shot: dict[str, Any]) -> None:
    """Draw a frame with both markers."""
    data = np.frombuffer(base64.b64decode(shot["frame"]), np.uint8)
    frame = cv2.cvtColor(np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR)), cv2.COLOR_BGR2RGB)
    axes.imshow(frame)
    for name, colour in (("seen", SEEN), ("estimated", ESTIMATED)):
        if shot[name] is not None:
            outline = np.array([*shot[name], shot[name][0]])
            axes.plot(*outline.T, color=colour, lw=2, label=name)
    axes.set_xlim(0, frame.shape[1])
    axes.set_ylim(frame.shape[0], 0)
    axes.set_xticks([])
    axes.set_yticks([])


def draw_errors(axes: Axes, results: Results, condition: str) -> None:
    """Draw errors by group over the times of the visits."""
    visits = [result[condition]["visits"] for result in results.values()]
    time = np.median([v["time"] for v in visits], axis=0)
    for group, joints in group_joints().items():
        curves = np.array([_filled(v, "estimate_seen", joints) for v in visits])
        colour = GROUP_COLOURS.get(group, "black")
        axes.plot(time, np.nanmedian(curves, axis=0), color=colour, label=f"{group}, seen")
        if group == "shoulder":
            low, high = np.nanquantile(curves, [0.25, 0.75], axis=0)
            axes.fill_between(time, low, high, color=colour, alpha=0.2, lw=0)
    true = np.array([rmse_deg(v, "estimate_true") for v in visits])
    axes.plot(time, np.median(true, axis=0), ":", color="black", label="all, true")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time [s]")


def _filled(visits: dict[str, list[Any]], pair: str, joints: np.ndarray) -> Floats:
    """RMSE at each visit [deg]; NaN where the hand was not seen."""
    seen = np.array([angles is not None for angles in visits["seen"]])
    result = np.full(len(seen), np.nan)
    result[seen] = rmse_deg(visits, pair, joints)
    return result
