"""Command line: `python -m kengoro.remote_robot TASK` serves a simulated robot.

It prints the port. The token comes from the environment, see `kengoro.remote_robot.token`.
"""

from __future__ import annotations

import argparse
import socket
import sys
from collections.abc import Sequence

from kengoro.errors import UsageError
from kengoro.remote_robot.client import HOST
from kengoro.remote_robot.server import RobotServer, ServerOptions
from kengoro.remote_robot.token import read_token
from kengoro_env.errors import KengoroError


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve a simulated robot until it is asked to end; returns the exit code."""
    parser = argparse.ArgumentParser("python -m kengoro.remote_robot", description=__doc__)
    parser.add_argument("task", help='of the environment, such as "Posture"')
    parser.add_argument("--seed", type=int, help="of the actual robot; the nominal model without")
    parser.add_argument("--host", default=HOST, help="address to listen at; 0.0.0.0 for all")
    parser.add_argument("--port", type=int, default=0, help="to listen at; a free one without")
    parser.add_argument("--period", type=float, help="of its own clock [s]; without, it waits")
    parser.add_argument("--sessions", type=int, help="number of sessions after which it ends")
    args = parser.parse_args(arguments)
    try:
        token = read_token()
        options = ServerOptions(period=args.period, sessions=args.sessions)
        # MuJoCo is slow to import: not before the arguments are known to be right.
        from kengoro.remote_robot.simulated import SimulatedRobot

        with SimulatedRobot(args.task, args.seed) as robot, _listener(args.host, args.port) as line:
            print(line.getsockname()[1], flush=True)
            RobotServer(robot, robot.muscles, line, token, options).serve()
    except (UsageError, KengoroError) as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def _listener(host: str, port: int) -> socket.socket:
    try:
        if not 0 <= port < 1 << 16:
            raise OverflowError("ports are 0 to 65535")
        return socket.create_server((host, port))
    except (OSError, OverflowError) as error:
        raise UsageError(
            f"The robot cannot listen at {host}, port {port} ({error}); --host is an address of "
            "this computer, and --port 0 takes a free port."
        ) from error


if __name__ == "__main__":
    sys.exit(main())
