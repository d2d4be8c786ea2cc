"""A robot that is served through a socket: who may drive it, and when it stops."""

from __future__ import annotations

import socket
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kengoro.errors import UsageError
from kengoro.remote_robot.clients import MAX_PENDING
from kengoro.remote_robot.server import AGENT, CONNECTION, WATCHDOG, RobotServer, ServerOptions
from tests.kengoro.remote_robot.serving import (
    PERIOD,
    TOKEN,
    Plant,
    RawClient,
    RawDriver,
    command,
    served,
)

PERIODS = 5
"""Most periods until a robot is stopped."""


def test_readings_and_commands_pass_unchanged() -> None:
    with served(1, period=None) as robot:
        client = robot.client()
        for number in (1, 2):
            readings = client.read()
            assert readings is not None
            assert readings.time == 1.7e9 + PERIOD * number
            np.testing.assert_array_equal(readings.lengths, [number, np.nan])
            np.testing.assert_array_equal(readings.frame, np.full((2, 3, 3), number))
            assert readings.frame_time == -np.inf
            client.write(np.array([0.1, 1.0 / 3.0]))
        client.read()
        client.stop()
    np.testing.assert_array_equal(robot.plant.commands, [[0.1, 1.0 / 3.0]] * 2)
    assert [stopped.by for stopped in robot.stopped] == [AGENT]


@pytest.mark.parametrize("period", [None, PERIOD])
def test_a_second_client_is_refused_and_the_first_goes_on(period: float | None) -> None:
    with served(1, period=period) as robot:
        first = robot.client()
        for _ in range(3):
            readings = first.read()
            first.write(np.zeros(2))
            with pytest.raises(UsageError, match="Another client drives this robot"):
                robot.client()
        assert readings is not None
        assert robot.stopped == []
        first.stop()


def test_a_client_without_the_token_is_refused() -> None:
    with served(1) as robot:
        with pytest.raises(UsageError, match="token is not the robot's"):
            robot.client("another token of the tests")
        assert robot.stopped == []
        robot.client().stop()


def test_something_else_that_listens_is_not_taken_for_the_robot() -> None:
    """It answers every challenge, but cannot prove that it knows the token."""
    import threading

    from kengoro.remote_robot.client import RemoteRobot
    from kengoro.remote_robot.messages import Message

    def impostor(listener: socket.socket) -> None:
        line, _ = listener.accept()
        with line:
            line.sendall(Message({"kind": "challenge", "challenge": "1"}).encoded())
            welcome = {"kind": "welcome", "answer": "0" * 64, "muscles": 2, "period": None}
            line.sendall(Message(welcome).encoded())
            line.recv(1000)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=impostor, args=(listener,), daemon=True).start()
        with pytest.raises(UsageError, match="does not know the token"):
            RemoteRobot(listener.getsockname()[1], token="a token of the tests", patience=5.0)


def test_silent_clients_are_turned_away_and_hold_up_no_other() -> None:
    with served(1, proof=0.2) as robot:
        silent = [RawClient(robot) for _ in range(MAX_PENDING)]
        for client in silent:
            client.hear()
        assert "No token was proved" in silent[0].reason()
        driving = robot.client()
        driving.read()
        driving.stop()


MALFORMED = {
    "a head of 2147483647 bytes": ("", 2**31 - 1),
    "a head of 0 bytes": ("", 0),
    "not JSON": ("{", None),
    "is not JSON": ("[" * 60_000, None),
    "not a JSON object": ("[1, 2]", None),
    "'target_lengths' must be finite numbers": (command(lengths=(float("nan"), 0.0)), None),
    "must be finite numbers": (command(lengths=(float("inf"), 0.0)), None),
    "'target_lengths' must be a list of 2 numbers": (command(lengths=(0.0,) * 3), None),
    "'target_lengths' must be numbers": (command(lengths=(True, "1")), None),
    "'number' must be an integer": (command(number=-1), None),
    "a frame of 1000000 bytes": (command().replace('"bytes": 0', '"bytes": 1000000'), None),
    "'bytes' must be an integer": (command().replace('"bytes": 0', '"bytes": null'), None),
    "of the kind 'dance'": (command().replace("command", "dance"), None),
}


def test_messages_that_are_not_valid_stop_the_robot_with_a_sentence() -> None:
    with served(len(MALFORMED)) as robot:
        for sentence, (text, size) in MALFORMED.items():
            client = RawDriver(robot)
            client.send_text(text, size)
            assert sentence in client.reason()
    assert robot.plant.commands == []
    assert robot.plant.stops == len(MALFORMED) + 1


def test_the_same_from_a_client_that_does_not_drive_disturbs_no_other() -> None:
    with served(1) as robot:
        driving = robot.client()
        for text, size in list(MALFORMED.values())[:4]:
            client = RawClient(robot)
            client.hear()
            client.send_text(text, size)
            assert client.reason()
            driving.read()
            driving.write(np.zeros(2))
        driving.stop()
    assert [stopped.by for stopped in robot.stopped] == [AGENT]


def test_the_watchdog_stops_a_robot_without_fresh_commands_and_another_agent_may_follow() -> None:
    with served(2) as robot:
        first = robot.client()
        first.read()
        first.write(np.zeros(2))
        robot.wait(lambda: bool(robot.plant.commands))
        tick = robot.server.tick
        robot.wait(lambda: bool(robot.stopped))
        assert robot.stopped[0].by == WATCHDOG
        assert robot.stopped[0].tick - tick <= PERIODS
        with pytest.raises(UsageError, match="no fresh command came for 4 control periods"):
            first.read()
        first.stop()
        second = robot.client()
        second.read()
        second.stop()
    assert [stopped.by for stopped in robot.stopped] == [WATCHDOG, AGENT]


def test_commands_that_the_network_repeats_are_not_fresh() -> None:
    with served(1) as robot:
        client = RawDriver(robot)
        while not robot.stopped:
            client.send_text(command(number=3))
            time.sleep(0.25 * PERIOD)
    assert [stopped.by for stopped in robot.stopped] == [WATCHDOG]
    assert len(robot.plant.commands) == 1


def test_a_pause_holds_the_robot_without_commands() -> None:
    with served(1) as robot:
        client = robot.client()
        client.read()
        client.write(np.zeros(2))
        client.pause()
        robot.wait(lambda: robot.server.tick > 20)
        assert robot.stopped == []
        readings = client.read()
        assert readings is not None
        assert client.overtaken >= 5
        client.stop()


def test_a_connection_that_ends_stops_the_robot() -> None:
    with served(1) as robot:
        client = RawDriver(robot)
        client.line.close()
    assert [stopped.by for stopped in robot.stopped] == [CONNECTION]


def test_a_client_that_never_commands_does_not_keep_the_robot_for_ever() -> None:
    with served(1, patience=0.2) as robot:
        client = RawDriver(robot)
        assert "no message came for 0.2 s" in client.reason()


def test_a_client_that_takes_no_readings_does_not_hold_up_the_robot() -> None:
    with served(1, plant=Plant(60_000)) as robot:
        client = RawDriver(robot)
        number, end = 0, time.monotonic() + 0.6
        while time.monotonic() < end:
            client.send_text(command(number := number + 1))
            time.sleep(PERIOD)
        assert robot.stopped == []
        assert robot.server.tick >= 20
        client.line.close()


def test_readings_that_do_not_come_in_time_are_none() -> None:
    with served(1) as robot:
        client = robot.client()
        readings = [client.read() for _ in range(5)]
        assert all(found is not None for found in readings)
        read, robot.plant.read = robot.plant.read, lambda: None  # type: ignore[method-assign]
        robot.wait(lambda: client.read() is None)
        robot.plant.read = read  # type: ignore[method-assign]
        robot.wait(lambda: client.read() is not None)
        client.stop()


@pytest.mark.parametrize(
    ("name", "value"),
    [("period", 0.0), ("period", np.nan), ("periods", 0), ("patience", -1.0), ("sessions", 1.5)],
)
def test_options_that_are_not_positive_are_refused(name: str, value: float) -> None:
    with pytest.raises(UsageError, match=name):
        ServerOptions(**{name: value})  # type: ignore[arg-type]


def test_a_driver_without_stop_is_not_served() -> None:
    driver: Any = SimpleNamespace(read=print, write=print)
    with (
        socket.create_server(("127.0.0.1", 0)) as listener,
        pytest.raises(ValueError, match="lacks the method stop"),
    ):
        RobotServer(driver, 2, listener, TOKEN)
