"""Reference driver: an agent drives a robot in another process through a socket.

`RemoteRobot` is a `jmm_agent.driver.Driver`, with the same three methods as the driver of a real
robot: sensor readings and frames come in, target lengths go out. The simulated robot waits for each
command.

A message is the length of its head (4 bytes, big endian), the head in JSON, and as many bytes of a
frame as the head says.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro.errors import UsageError

HOST = "127.0.0.1"
PATIENCE = 60.0
"""How long each side waits for the other [s]."""


class RemoteRobot:
    """Driver of a robot that `serve` runs in another process on this computer.

    Args:
        port: that the robot listens on.
    """

    def __init__(self, port: int) -> None:
        self._line = socket.create_connection((HOST, port), PATIENCE)

    def read(self) -> SensorReadings:
        """Wait for the next sensor readings."""
        head, body = _receive(self._line)
        shape = head["frame"]
        frame = np.frombuffer(body, np.uint8).reshape(shape) if shape else None
        lengths, tensions = (np.array(head[name]) for name in ("lengths", "tensions"))
        return SensorReadings(head["time"], lengths, tensions, frame, head["frame_time"])

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths (m,) [m]."""
        _send(self._line, {"target_lengths": [float(x) for x in target_lengths]})

    def stop(self) -> None:
        """End the connection, on which the robot stops; may be called again."""
        with self._line, suppress(OSError):
            _send(self._line, {"target_lengths": None})


def serve(task: str, seed: int | None, listener: socket.socket) -> None:
    """Run a simulated robot for the first client, until it ends the connection.

    Args:
        task: of the environment, such as "Posture".
        seed: of the actual robot and of its sensor noise; None for the nominal model.
        listener: socket that is bound and listens.
    """
    listener.settimeout(PATIENCE)
    from kengoro.robots import NO_END, make_env
    from kengoro_env.env import KengoroEnv

    line, _ = listener.accept()
    env = make_env(task, seed, max_episode_steps=NO_END)
    world = env.unwrapped
    assert isinstance(world, KengoroEnv)
    observation, _ = env.reset(seed=seed or 0)
    step = 0
    # A client may also end without a last message.
    with line, env, suppress(ConnectionError):
        line.settimeout(PATIENCE)
        while True:
            frame = observation.get("frame")
            seen = frame is not None
            head = {
                "time": step * float(world.robot.control_period),
                "lengths": observation["lengths"].tolist(),
                "tensions": observation["tensions"].tolist(),
                "frame": list(frame.shape) if seen else None,
                "frame_time": float(observation["frame_time"][0]) if seen else -1.0,
            }
            _send(line, head, frame.tobytes() if seen else b"")
            command = _receive(line)[0]["target_lengths"]
            if command is None:
                return
            observation, *_ = env.step(world.lengths_to_action(np.array(command)))
            step += 1


@contextmanager
def robot_process(task: str, seed: int | None) -> Iterator[RemoteRobot]:
    """A simulated robot in a process of its own, and its driver.

    Args:
        task: of the environment, such as "Posture".
        seed: of the actual robot; None for the nominal model.

    Raises:
        UsageError: the process of the robot ended.
    """
    # Not multiprocessing, which imports the caller's script again in the new process.
    process = subprocess.Popen(
        [sys.executable, "-m", __name__, task, *([] if seed is None else [str(seed)])],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        stdout=subprocess.PIPE,
    )
    with process:
        assert process.stdout is not None
        port = process.stdout.readline()
        if not port:
            raise UsageError(f"The process of the robot ended at its start, with task {task!r}.")
        robot = RemoteRobot(int(port))
        try:
            yield robot
        except ConnectionError as error:
            raise UsageError(
                "The process of the robot has ended the connection; its own message is above."
            ) from error
        finally:
            robot.stop()


def _send(line: socket.socket, head: dict[str, Any], body: bytes = b"") -> None:
    text = json.dumps(head | {"bytes": len(body)}).encode()
    line.sendall(len(text).to_bytes(4, "big") + text + body)


def _receive(line: socket.socket) -> tuple[dict[str, Any], bytes]:
    head = json.loads(_exactly(line, int.from_bytes(_exactly(line, 4), "big")))
    return head, _exactly(line, head["bytes"])


def _exactly(line: socket.socket, count: int) -> bytes:
    parts = bytearray()
    while len(parts) < count:
        part = line.recv(count - len(parts))
        if not part:
            raise ConnectionError("the other process has ended the connection")
        parts += part
    return bytes(parts)


def main(task: str, seed: str | None = None) -> None:
    """Print the port of a simulated robot, and run the robot for one client."""
    with socket.create_server((HOST, 0)) as listener:
        print(listener.getsockname()[1], flush=True)
        serve(task, None if seed is None else int(seed), listener)


if __name__ == "__main__":
    main(*sys.argv[1:])
