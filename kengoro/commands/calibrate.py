"""`kengoro calibrate`: walk through clock, zero posture, signs, gains, limit and camera of a robot.

Each question can be answered by an option; where there is a terminal, what was left out is asked.
The answers and what was measured are written to a file that `kengoro.load_calibration` reads.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from rich import get_console
from rich.markup import escape

from jmm_agent.driving.driver import Driver
from jmm_agent.driving.stopping import stopping
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.options import AgentOptions
from jmm_agent.vision.camera import Camera
from kengoro.calibration.calibration_file import Calibration
from kengoro.calibration.checks import (
    RobotChecks,
    camera_problems,
    length_problems,
    limit_problems,
)
from kengoro.errors import UsageError
from kengoro.nominal_robot import NominalRobot
from kengoro.remote_robot.client import HOST, RemoteRobot
from kengoro.remote_robot.simulated import SimulatedRobot
from kengoro.robots import arm_scene, check_seed, sample_within
from kengoro_env.errors import KengoroError
from kengoro_env.robot.nominal_model import SAMPLES

EYE = AgentOptions().camera
"""Name of the camera in the nominal model."""
POSTURES = 20
"""Number of postures at which the limit of the tensions is checked."""
ZERO_SHARE = 0.15
"""Largest length in the zero posture, as a share of the muscles' travel [1]."""

T = TypeVar("T")
D = TypeVar("D")


class Question(Protocol):
    """Returns what was given, or else an answer or the default."""

    def __call__(self, text: str, given: T | None, default: D, read: Callable[[str], T]) -> T | D:
        """Ask one question.

        Args:
            text: of the question.
            given: by an option; None if it was left out.
            default: answer without words.
            read: converts an answer; raises ValueError if it does not fit.
        """


@dataclass(frozen=True)
class Args:
    """Check a robot before an agent drives it, and write what was given and measured.

    Attributes:
        out: file to write (JSON).
        port: port of the robot, see `kengoro.RobotServer`; a simulated robot if left out.
        host: name or address of the robot's computer.
        robot: seed of the simulated robot; the nominal model if left out.
        scene: MJCF file of the nominal model; Kengoro's arm if left out.
        camera: calibration file of the camera, of OpenCV or ROS; the model's camera if left out.
        marker: number of the hand's marker.
        marker_side: side of the hand's marker [m].
        stiffness: K_stiff of the motors [N/m]; by the model if left out.
        bias: T_bias of the motors [N]; by the model if left out.
        limit: largest tension of a motor [N]; by the model if left out.
        zeroed: whether the robot stands in its zero posture now and lengths were zeroed there;
            not checked if left out without a terminal.
        pull: additional tension by which each muscle is pulled [N]; 0: none is pulled.
        ask: whether to ask for what was left out; only where there is a terminal if left out.
    """

    out: Path = Path("calibration.json")
    port: int | None = None
    host: str = HOST
    robot: int | None = None
    scene: Path | None = None
    camera: Path | None = None
    marker: int = 0
    marker_side: float | None = None
    stiffness: float | None = None
    bias: float | None = None
    limit: float | None = None
    zeroed: bool | None = None
    pull: float | None = None
    ask: bool | None = None


def main(args: Args) -> None:
    """Check the robot, write the file, and print what is wrong.

    Raises:
        UsageError: something is wrong, or an option is not valid.
    """
    console = get_console()
    ask = sys.stdin.isatty() if args.ask is None else args.ask
    calibration = calibrate(args, ask, lambda text: console.print(f"  {escape(text)}"))
    calibration.save(args.out)
    for problem in calibration.problems:
        console.print(f"[red]wrong[/red]  {escape(problem)}")
    count = len(calibration.problems)
    if count:
        raise UsageError(f"{args.out} is written; {count} of the checks found something wrong.")
    console.print(f"Nothing is wrong. {args.out}: kengoro.load_calibration(...).make_agent()")


def calibrate(args: Args, ask: bool, progress: Callable[[str], None]) -> Calibration:
    """Ask, measure and check.

    Args:
        args: options.
        ask: whether to ask for what was left out.
        progress: called with each step, in a few words.

    Raises:
        UsageError: an option is not valid, or the robot does not answer.
    """
    question = _asked if ask else _default
    if args.robot is not None:
        check_seed(args.robot)
    model = NominalRobot(arm_scene() if args.scene is None else args.scene)
    given = _given(args, model, question)
    camera = _camera(given, model)
    motors = given.motors
    arm = model.arm
    with _driver(args) as driver, stopping(driver):
        checks = RobotChecks(driver, model.model.muscles, motors, progress)
        problems = checks.clock()
        nominal = arm.lengths(sample_within(arm, SAMPLES, share=1.0))
        problems += length_problems(checks.newest.lengths, nominal, arm.muscles)
        if given.zeroed:
            problems += checks.zero(ZERO_SHARE * arm.travel)
        pull = question("Pull of each muscle [N], 0 for none", args.pull, motors.bias, float)
        if not 0.0 <= pull < np.inf:
            raise UsageError(f"pull is {pull:g} N, but must be 0 or more, and finite.")
        if pull > 0.0:
            problems += checks.pulls(pull)
        progress("limit and camera")
        if camera is None:
            problems.append(f"The model has no camera {EYE!r}: give --camera.")
        else:
            problems += camera_problems(checks.newest, camera, given.marker, given.marker_side)
    problems += limit_problems(model.statics(motors), sample_within(arm, POSTURES), motors)
    period, jitter = (
        None if value is None else float(f"{value:.4g}") for value in (checks.period, checks.jitter)
    )
    return replace(given, period=period, jitter=jitter, problems=tuple(problems))


def _given(args: Args, model: NominalRobot, question: Question) -> Calibration:
    """What options and answers say."""
    by_model = model.motors()
    camera = question(
        "Calibration file of the camera, nothing for the model's", args.camera, None, Path
    )
    side = question("Side of the hand's marker [m]", args.marker_side, 0.05, float)
    gains = (
        question("Stiffness of the motors [N/m]", args.stiffness, by_model.stiffness, float),
        question("Least tension, T_bias [N]", args.bias, by_model.bias, float),
        question("Largest tension of a motor [N]", args.limit, by_model.limit, float),
    )
    zeroed = question(
        "Does the robot stand in its zero posture, and were its lengths zeroed there", args.zeroed,
        None, _yes,
    )  # fmt: skip
    if not 0.0 < side < np.inf:
        raise UsageError(f"marker_side is {side:g} m, but must be above 0 and finite.")
    if args.marker < 0:
        raise UsageError(f"marker is {args.marker}, but numbers of markers are not negative.")
    try:
        MotorControl(*gains)
    except AgentError as error:
        raise UsageError(f"Gains and limit do not fit: {error}") from error
    return Calibration(
        None if args.scene is None else str(args.scene.resolve()),
        None if camera is None else str(camera.resolve()),
        args.marker,
        side,
        *gains,
        zeroed,
    )


def _camera(given: Calibration, model: NominalRobot) -> Camera | None:
    """The camera that is given, else that of the model; None if there is neither."""
    if given.camera is not None:
        return Camera.from_file(given.camera)
    return model.camera(EYE) if EYE in model.cameras else None


@contextmanager
def _driver(args: Args) -> Iterator[Driver]:
    """Driver of the robot: in another process, or simulated."""
    if args.port is not None:
        yield RemoteRobot(args.port, args.host)
        return
    if args.scene is not None:
        raise UsageError("Only Kengoro's arm is simulated: give --port of the robot of your scene.")
    try:
        robot = SimulatedRobot("Posture", args.robot)
    except KengoroError as error:
        raise UsageError(str(error)) from error
    with robot:
        yield robot


def _default(text: str, given: T | None, default: D, read: Callable[[str], T]) -> T | D:
    """The answer of an option, or the default."""
    return default if given is None else given


def _asked(text: str, given: T | None, default: D, read: Callable[[str], T]) -> T | D:
    """The answer of an option, or of a person at a terminal."""
    while given is None:
        shown = "" if default is None else f" ({default})"
        answer = input(f"{text}?{shown} ").strip()
        if not answer:
            return default
        try:
            given = read(answer)
        except ValueError:
            print(f"{answer!r} does not fit.", file=sys.stderr)
    return given


def _yes(answer: str) -> bool:
    known = {"y": True, "yes": True, "n": False, "no": False}
    if answer.lower() not in known:
        raise ValueError(answer)
    return known[answer.lower()]
