"""File of a robot's calibration (JSON), from which an agent is made."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.guard.faults import MotorControl
from jmm_agent.scales import RobotScales
from jmm_agent.vision.camera import Camera
from kengoro.agents import make_agent
from kengoro.errors import UsageError
from mjcf_sandbox.files import write_json

FORMAT = "kengoro-calibration-1"
MAX_BYTES = 1 << 20
"""Largest file [bytes]."""


@dataclass(frozen=True)
class Calibration:
    """What was given, measured and found wrong.

    Attributes:
        scene: MJCF file of the nominal model; None for Kengoro's arm.
        camera: calibration file of the camera; None for the camera of the model.
        marker: number of the hand's marker.
        marker_side: side of the hand's marker [m].
        stiffness: K_stiff of the motors [N/m].
        bias: T_bias of the motors [N].
        limit: largest tension [N].
        zeroed: whether lengths were zeroed in the zero posture; None if unknown.
        period: median control period, as measured [s].
        jitter: standard deviation of the control period [s].
        problems: what is wrong, a sentence each.
    """

    scene: str | None = None
    camera: str | None = None
    marker: int = 0
    marker_side: float = RobotScales.marker_side
    stiffness: float = MotorControl.stiffness
    bias: float = MotorControl.bias
    limit: float = MotorControl.limit
    zeroed: bool | None = None
    period: float | None = None
    jitter: float | None = None
    problems: tuple[str, ...] = ()

    @property
    def motors(self) -> MotorControl:
        """Gains and limit of the motors.

        Raises:
            AgentError: a number is not positive, or the bias is above the limit.
        """
        return MotorControl(self.stiffness, self.bias, self.limit)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file, whole or not at all.

        Args:
            path: of the file; its folder is made.
        """
        write_json(Path(path), {"format": FORMAT, **asdict(self)})

    def make_agent(self, seed: int = 0, **more: Any) -> Agent:
        """An agent of the calibrated robot.

        Args:
            seed: of the rehearsal pairs that learning samples.
            **more: of `kengoro.make_agent`.

        Raises:
            AgentError: a file is missing or does not fit.
        """
        camera = None if self.camera is None else Camera.from_file(self.camera)
        sides = {self.marker: self.marker_side}
        given = {"scene": self.scene, "camera": camera, "marker_sides": sides}
        return make_agent(seed, **{**given, "motors": self.motors, **more})


def load_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a file that `kengoro calibrate` wrote.

    Args:
        path: of the file.

    Raises:
        UsageError: the file is missing or holds no calibration; nothing else is read.
    """
    path = Path(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ValueError(f"it has more than {MAX_BYTES} bytes")
        content = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(content, dict) or content.pop("format", None) != FORMAT:
            raise ValueError(f"its format is not {FORMAT}")
        names = [entry.name for entry in fields(Calibration)]
        if unknown := set(content) - set(names):
            raise ValueError(f"{sorted(unknown)[0]!r} is unknown; known are {', '.join(names)}")
        return _checked(content)
    except (OSError, ValueError, RecursionError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UsageError(f"{path} holds no calibration: {reason.rstrip('.')}.") from error


def _checked(content: dict[str, Any]) -> Calibration:
    """The calibration, if each entry is of its kind."""
    for name, value in content.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        number = number and bool(np.isfinite(value)) and value > 0
        optional = value is None and name in ("scene", "camera", "zeroed", "period", "jitter")
        fits = {
            "scene": isinstance(value, str),
            "camera": isinstance(value, str),
            "zeroed": isinstance(value, bool),
            "marker": isinstance(value, int) and not isinstance(value, bool) and value >= 0,
            "jitter": number or value == 0.0,
            "problems": isinstance(value, list) and all(isinstance(each, str) for each in value),
        }.get(name, number)
        if not (optional or fits):
            raise ValueError(f"{name} is {value!r}, which does not fit")
    content["problems"] = tuple(content.get("problems", ()))
    calibration = Calibration(**content)
    _ = calibration.motors  # refuses a bias above the limit
    return calibration
