"""A robot in another process, which an agent drives through a socket.

An example of `jmm_agent.driver.Driver`: the simulated robot knows no agent, the agent no simulator,
and between them go lengths, tensions and frames one way, target lengths the other. A driver of a
real robot has the same three methods. The simulated one waits for each command.
"""

from __future__ import annotations

import json
import multiprocessing
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro.errors import UsageError

HOST = "127.0.0.1"
PATIENCE = 60.0
"""How long either side waits for the other [s]."""


class RemoteRobot:
    """The robot as seen from the agent's process: a `Driver`.

    Args:
        port: where `serve` listens on this machine.
    """

    def __init__(self, port: int) -> None:
        self._line = socket.create_connection((HOST, port), PATIENCE)

    def read(self) -> SensorReadings:
        """Wait for what is felt and seen."""
        head, body = _receive(self._line)
        shape = head["frame"]
        frame = np.frombuffer(body, np.uint8).reshape(shape) if shape else None
        lengths, tensions = (np.array(head[name]) for name in ("lengths", "tensions"))
        return SensorReadings(head["time"], lengths, tensions, frame, head["frame_time"])

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths (m,) [m]."""
        _send(self._line, {"target_lengths": [float(x) for x in target_lengths]})

    def stop(self) -> None:
        """Say goodbye, if that was not done."""
        with self._line, suppress(OSError):
            _send(self._line, {"target_lengths": None})


def serve(task: str, seed: int | None, listener: socket.socket) -> None:
    """Be a robot for whoever calls: feel, wait for a command, obey; until they say goodbye.

    Args:
        task: of the environment, as "Posture".
        seed: of the actual robot, and of its sensors' noise; None for the drawing.
        listener: bound and listening.
    """
    from kengoro.arm import NO_END, make_env
    from kengoro_env.env import KengoroEnv

    line, _ = listener.accept()
    env = make_env(task, seed, max_episode_steps=NO_END)
    world = env.unwrapped
    assert isinstance(world, KengoroEnv)
    observation, _ = env.reset(seed=seed or 0)
    step = 0
    # Who hangs up without goodbye is gone, too.
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
    """A robot in a process of its own."""
    with socket.create_server((HOST, 0)) as listener:
        process = multiprocessing.get_context("spawn").Process(
            target=serve, args=(task, seed, listener), daemon=True
        )
        process.start()
        robot = RemoteRobot(listener.getsockname()[1])
    try:
        yield robot
    except ConnectionError as error:
        raise UsageError(f"The robot's process has hung up: {error}.") from error
    finally:
        robot.stop()
        process.join(PATIENCE)


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
            raise ConnectionError("the other process has hung up")
        parts += part
    return bytes(parts)
