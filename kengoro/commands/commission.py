"""`kengoro commission`: pull each muscle a little, and name what is connected wrongly.

Prints a sentence for each finding, and writes a picture of what was predicted and measured.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich import get_console
from rich.markup import escape

from jmm_agent.commissioning.commissioning import Commissioning
from jmm_agent.driving.commission import commission
from jmm_agent.driving.driver import Driver
from jmm_agent.driving.stopping import stopping
from jmm_agent.guard.faults import MotorControl
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.errors import UsageError
from kengoro.remote_robot.client import HOST, RemoteRobot
from kengoro.remote_robot.simulated import SimulatedRobot
from kengoro.robots import SIDES, check_seed
from kengoro_env.errors import KengoroError


@dataclass(frozen=True)
class Args:
    """Pull each muscle of a robot a little, before anything is learned, and name its faults.

    Attributes:
        out: picture to write (PNG).
        port: port of the robot, see `kengoro.RobotServer`; a simulated robot if left out.
        host: name or address of the robot's computer.
        robot: seed of the simulated robot; the nominal model if left out.
        scene: MJCF file of the nominal model; Kengoro's arm if left out.
        marker_side: side of the hand's marker [m].
        stiffness: K_stiff of the motors [N/m]; by the model if left out.
        bias: T_bias of the motors [N]; by the model if left out.
        limit: largest tension of a motor [N]; by the model if left out.
    """

    out: Path = Path("out/commissioning.png")
    port: int | None = None
    host: str = HOST
    robot: int | None = None
    scene: Path | None = None
    marker_side: float = 0.05
    stiffness: float | None = None
    bias: float | None = None
    limit: float | None = None


def main(args: Args) -> None:
    """Run, print what was found, and write the picture.

    Raises:
        UsageError: something is wrong with the robot, or an option is not valid.
    """
    console = get_console()
    with console.status("Preparing the nominal model ..."):
        agent = make_agent(
            scene=args.scene,
            marker_sides=SIDES if args.scene is None else {0: args.marker_side},
            motors=_motors(args),
            learning=False,
        )
    pulling = console.status(f"Pulling {len(agent.map.muscles)} muscles, one after the other ...")
    with _driver(args) as (driver, held), stopping(driver), pulling:
        result = commission(agent, driver, held=held)
    for finding in result.findings:
        console.print(f"[red]{finding.kind}[/red]  {escape(finding.sentence)}")
    for finding in result.undecided:
        console.print(f"[yellow]{finding.kind}[/yellow]  {escape(finding.sentence)}")
    console.print(escape(str(result).splitlines()[-1]))
    if result.record is not None:
        _picture(result, args.out)
        console.print(f"Picture: {args.out}")
    if result.findings:
        raise UsageError(f"The commissioning run found {len(result.findings)} fault(s).")


def _motors(args: Args) -> MotorControl | None:
    """Gains and limit that are given; None for those of the model."""
    given = (args.stiffness, args.bias, args.limit)
    if all(value is None for value in given):
        return None
    stiffness, bias, limit = given
    if stiffness is None or bias is None or limit is None:
        raise UsageError("Give stiffness, bias and limit together, or none of them.")
    return MotorControl(stiffness, bias, limit)


@contextmanager
def _driver(args: Args) -> Iterator[tuple[Driver, Floats | None]]:
    """Driver of the robot, in another process or simulated, and what its motors hold."""
    if args.port is not None:
        yield RemoteRobot(args.port, args.host), None
        return
    if args.scene is not None:
        raise UsageError("Only Kengoro's arm is simulated: give --port of the robot of your scene.")
    if args.robot is not None:
        check_seed(args.robot)
    try:
        robot = SimulatedRobot("Posture", args.robot)
    except KengoroError as error:
        raise UsageError(str(error)) from error
    with robot:
        yield robot, None


def _picture(result: Commissioning, path: Path) -> None:
    """Write a picture of a result."""
    from kengoro.commissioning_picture import draw_responses

    path.parent.mkdir(parents=True, exist_ok=True)
    draw_responses(result, path)
