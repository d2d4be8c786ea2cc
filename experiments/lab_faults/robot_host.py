"""Process of the robot: serves it in real time, and breaks the line on command.

It prints events as lines of JSON. A line of JSON on its standard input begins a fault:
``{"kind": ..., "periods": ...}``; without a kind it ends one. The answer holds the number of the
control period.
"""

from __future__ import annotations

import json
import socket
import sys
import threading
from typing import Any

from experiments.lab_faults.faulty_connection import FaultyConnection, LineFault
from experiments.lab_faults.lab_robot import LabRobot
from experiments.lab_faults.processes import raise_priority
from kengoro.remote_robot.server import RobotServer, ServerOptions, Stopped
from kengoro.remote_robot.token import read_token


def print_event(**event: Any) -> None:
    """Print an event."""
    sys.stdout.write(json.dumps(event) + "\n")
    sys.stdout.flush()


def obey(fault: LineFault) -> None:
    """Begin the faults that the standard input names, until it ends."""
    for line in sys.stdin:
        order = json.loads(line)
        tick = fault.tick()
        fault.begin(order.get("kind", ""), order.get("periods", 0.0))
        print_event(event="fault", tick=tick)


def stopped(report: Stopped) -> None:
    """Print who stopped the robot."""
    print_event(event="stopped", by=report.by, reason=report.reason, tick=report.tick)


def main(period: str) -> None:
    """Serve the robot until the process is asked to end."""
    robot, fault, token = LabRobot(), LineFault(), read_token()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = RobotServer(
            robot,
            robot.muscles,
            listener,
            token,
            ServerOptions(period=float(period)),
            stopped,
            lambda line, deadline: FaultyConnection(line, deadline, fault),
        )
        fault.tick = lambda: server.tick
        threading.Thread(target=obey, args=(fault,), daemon=True).start()
        raise_priority()
        print_event(event="port", port=listener.getsockname()[1])
        server.serve()


if __name__ == "__main__":
    main(*sys.argv[1:])
