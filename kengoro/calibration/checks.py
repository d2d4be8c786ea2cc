"""Checks of a robot through its driver: clock, zero posture, signs, gains, limit and camera.

Each check returns sentences on what is wrong. The arm stays where it is: the robot holds the
lengths that it has, with all muscles at T_bias, and each muscle in turn is pulled a little more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.driving.driver import Driver
from jmm_agent.guard.faults import MotorControl
from jmm_agent.length_check import beyond_map
from jmm_agent.observation import CONTROL_PERIOD, SensorReadings
from jmm_agent.statics import Statics
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro.errors import UsageError

PERIODS = (0.005, 0.05)
"""Control periods that the agent is made for [s]."""
JITTER = 0.3
"""Largest standard deviation of the period, as a share of it [1]."""
LOST = 0.05
"""Largest share of cycles that are lost: longer than 1.5 periods [1]."""
SILENCE = 50
"""Number of cycles in a row without readings after which the robot counts as silent."""
MOVED = 0.1
"""Least movement of a muscle that is pulled, as a share of the change of its command [1]."""
RAISED = 0.3
"""Least rise of the tension of a muscle that does not move, as a share of the pull [1]."""
TAUT = 0.3
"""Least tension of a muscle that is pulled, as a share of T_bias [1]."""
GAIN = 1.5
"""Largest ratio of measured to given gains [1]."""
HELD = 0.5
"""Least share of typical postures that the muscles must be able to hold [1]."""

Progress = Callable[[str], None]


class _Rest(NamedTuple):
    """Mean lengths (m,) [m] and tensions (m,) [N] under a command, and the highest tensions."""

    lengths: Floats
    tensions: Floats
    highest: Floats


class RobotChecks:
    """Checks that move a robot a little.

    Args:
        driver: of the robot; the caller stops it.
        muscles: names of the m muscles of the nominal model.
        motors: gains and limit, as given.
        progress: called with each step of the checks, in a few words.

    Attributes:
        period: median control period [s], measured by `clock`; None if unknown.
        jitter: standard deviation of the control period [s]; None if unknown.

    Raises:
        UsageError: the robot has another number of muscles, or does not answer.
    """

    def __init__(
        self, driver: Driver, muscles: Sequence[str], motors: MotorControl, progress: Progress
    ) -> None:
        self._driver, self._muscles, self._motors = driver, muscles, motors
        self._progress = progress
        self.period: float | None = None
        self.jitter: float | None = None
        self.newest = self._read()
        found = len(np.atleast_1d(self.newest.lengths))
        if found != len(muscles):
            raise UsageError(
                f"The robot sends {found} lengths, but its nominal model has {len(muscles)} "
                f"muscles: {', '.join(muscles)}."
            )
        self._hold = np.array(self.newest.lengths, dtype=float)
        if not np.isfinite(self._hold).all():
            dead = self._muscles[int(np.flatnonzero(~np.isfinite(self._hold))[0])]
            raise UsageError(f"The encoder of {dead} reads no number; mend it first.")

    def clock(self, seconds: float = 4.0) -> list[str]:
        """Measure the control period while the robot holds its lengths.

        Args:
            seconds: duration [s], by the robot's own stamps.
        """
        self._progress("clock")
        stamps = [self.newest.time]
        while stamps[-1] - stamps[0] < seconds and len(stamps) < 100_000:
            stamps.append(self._step(self._hold).time)
            if len(stamps) > SILENCE and stamps[-1] <= stamps[0]:
                return ["The time stamps do not increase; they must be seconds."]
        steps = np.diff(stamps)
        problems = []
        if backward := int((steps <= 0).sum()):
            problems.append(f"{backward} of {len(steps)} time stamps are not later than the last.")
        forward = steps[steps > 0]
        self.period = period = float(np.median(forward))
        ordinary = forward[forward < 1.5 * period]
        lost = len(forward) - len(ordinary)
        self.jitter = jitter = float(np.std(ordinary))
        low, high = PERIODS
        if not 0.999 * low <= period <= 1.001 * high:
            problems.append(
                f"The control period is {1e3 * period:.3g} ms, but must be {1e3 * low:g} to "
                f"{1e3 * high:g} ms; are the stamps in seconds?"
            )
        if jitter > JITTER * period:
            problems.append(
                f"The period varies by {1e3 * jitter:.3g} ms, more than {JITTER:.0%} of "
                f"{1e3 * period:.3g} ms."
            )
        if lost > LOST * len(forward):
            problems.append(f"{lost} of {len(forward)} cycles were lost or late.")
        return problems

    def zero(self, tolerance: float) -> list[str]:
        """Compare the lengths with zero; the robot must be in its zero posture.

        Args:
            tolerance: largest length that counts as zero [m].
        """
        self._progress("zero posture")
        lengths = self._rest(self._hold).lengths
        wrong = np.flatnonzero(np.abs(lengths) > tolerance)
        if not wrong.size:
            return []
        worst = int(np.abs(lengths).argmax())
        return [
            f"In the zero posture {wrong.size} of {len(lengths)} lengths are farther than "
            f"{1e3 * tolerance:.3g} mm from zero, {self._muscles[worst]} by "
            f"{1e3 * lengths[worst]:+.3g} mm: zero them anew."
        ]

    def pulls(self, pull: float, rest: float = 0.3) -> list[str]:
        """Pull each muscle in turn by a little more tension, and see what it does.

        Args:
            pull: additional tension [N].
            rest: time until the muscle has moved [s].
        """
        motors = self._motors
        pull = min(pull, motors.limit - motors.bias)
        problems: list[str] = []
        gains: list[float] = []
        problems += self._bias(self._rest(self._hold, rest).tensions)
        for muscle, name in enumerate(self._muscles):
            self._progress(f"pull {name}")
            before = self._rest(self._hold, rest)
            command = self._hold.copy()
            command[muscle] = min(command[muscle], before.lengths[muscle])
            command[muscle] -= pull / motors.stiffness
            pulled = self._rest(command, rest)
            after = self._rest(self._hold, rest)
            # The arm may drift, so that the mean of before and after counts.
            still = 0.5 * (before.lengths[muscle] + after.lengths[muscle])
            moved = float(pulled.lengths[muscle] - still)
            raised = float(pulled.highest[muscle] - before.tensions[muscle])
            tension = float(pulled.tensions[muscle])
            problems += _pulled(name, moved, raised, tension, pull, motors)
            stretch = pulled.lengths[muscle] - command[muscle]
            if stretch > 0.3 * pull / motors.stiffness:
                gains.append(float((pulled.tensions[muscle] - motors.bias) / stretch))
        measured = float(np.median(gains)) if gains else float("nan")
        if gains and not 1 / GAIN < measured / motors.stiffness < GAIN:
            problems.append(
                f"K_stiff is {measured:.3g} N/m by tensions and lengths, but {motors.stiffness:g} "
                "N/m was given."
            )
        return problems

    def _bias(self, tensions: Floats) -> list[str]:
        motors, measured = self._motors, float(np.median(tensions))
        if 1 / GAIN < measured / motors.bias < GAIN:
            return []
        return [
            f"T_bias is {measured:.3g} N by the tensions of muscles that are not pulled, but "
            f"{motors.bias:g} N was given."
        ]

    def _rest(self, command: Floats, rest: float = 0.2) -> _Rest:
        """Readings under a command: the mean of their second half, and the highest tensions."""
        steps = max(8, round(rest / (self.period or CONTROL_PERIOD)))
        found = [self._step(command) for _ in range(steps)]
        lengths, tensions = (
            np.array([getattr(one, name) for one in found]) for name in ("lengths", "tensions")
        )
        half = steps // 2
        return _Rest(
            lengths[half:].mean(axis=0), tensions[half:].mean(axis=0), tensions.max(axis=0)
        )

    def _step(self, command: Floats) -> SensorReadings:
        self._driver.write(command)
        self.newest = self._read()
        return self.newest

    def _read(self) -> SensorReadings:
        for _ in range(SILENCE):
            readings = self._driver.read()
            if readings is not None:
                return readings
        raise UsageError(f"The robot sent no readings for {SILENCE} cycles.")


def _pulled(
    name: str, moved: float, raised: float, tension: float, pull: float, motors: MotorControl
) -> list[str]:
    """What is wrong with a muscle that moved by [m], and whose tension rose by [N] to [N]."""
    change = pull / motors.stiffness
    if moved > MOVED * change:
        return [
            f"{name} lengthens by {1e3 * moved:.2g} mm when it is pulled: its motor or its encoder "
            "has the wrong sign."
        ]
    if tension < TAUT * motors.bias:
        return [
            f"The tension of {name} is {tension:.3g} N while it is pulled: its sensor is dead or "
            "has the wrong sign, or the wire is slack."
        ]
    if raised < RAISED * pull and moved > -MOVED * change:
        return [
            f"{name} neither shortens nor pulls when it is pulled by {pull:g} N: its motor or its "
            "sensors do nothing."
        ]
    return []


def length_problems(lengths: Floats, nominal: Floats, muscles: Sequence[str]) -> list[str]:
    """Whether lengths are numbers, and about those of the nominal model, in metres.

    Args:
        lengths: measured (m,) [m].
        nominal: lengths of the nominal model in postures between the joint limits (K, m) [m].
        muscles: names of the m muscles.
    """
    low, high = nominal.min(axis=0), nominal.max(axis=0)
    problems = []
    if dead := [
        muscle for muscle, length in zip(muscles, lengths, strict=True) if np.isnan(length)
    ]:
        problems.append(f"The length of {', '.join(dead)} is no number: is the encoder connected?")
    beyond = beyond_map(lengths, low, high)
    worst = int(beyond.argmax())
    if beyond[worst] > 1.0:
        problems.append(
            f"{muscles[worst]} has a length of {lengths[worst]:.3g} m, but {low[worst]:.3g} to "
            f"{high[worst]:.3g} m by the nominal model: are lengths in metres, and zeroed?"
        )
    return problems


def limit_problems(statics: Statics, postures: Floats, motors: MotorControl) -> list[str]:
    """Whether the muscles can hold typical postures with the given limit.

    Args:
        statics: of the nominal model with these motors.
        postures: joint angles (K, n) [rad].
        motors: gains and limit.
    """
    held = [bool(statics.hold(posture).reachable) for posture in postures]
    if np.mean(held) >= HELD:
        return []
    return [
        f"With at most {motors.limit:g} N the muscles can hold {sum(held)} of {len(held)} typical "
        "postures of the nominal model: is the limit right?"
    ]


def camera_problems(
    readings: SensorReadings, camera: Camera, marker: int, side: float
) -> list[str]:
    """What is wrong with the newest frame, the camera's size and the marker.

    Args:
        readings: with the newest frame.
        camera: as calibrated.
        marker: number of the hand's marker.
        side: of the marker [m].
    """
    if readings.frame is None:
        return ["The robot sends no frame: nothing is learned without a camera or measured poses."]
    problems = []
    height, width = readings.frame.shape[:2]
    if (width, height) != (camera.width, camera.height):
        return [
            f"Frames are {width} x {height} pixels, but the camera is calibrated for "
            f"{camera.width} x {camera.height}."
        ]
    if not np.isfinite(readings.frame_time) or readings.frame_time > readings.time:
        problems.append("The frame's time is not one of the past, on the clock of the readings.")
    detections = MarkerDetector(camera, {marker: side}).detect(readings.frame)
    if marker not in detections.poses:
        why = detections.skips[marker].value
        others = ", ".join(map(str, detections.unexpected))
        others = f" (others are: {others})" if others else ""
        problems.append(f"Marker {marker} has no pose: {why}{others}.")
    return problems
