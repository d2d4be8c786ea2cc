"""The page of a run is for this computer only, and sends what is new to who looks."""

from __future__ import annotations

import base64
import http.client
import json
import socket
import urllib.request
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import cv2
import numpy as np
import pytest

from kengoro.viewer.web import Broadcast, PageServer, Shown, data_url
from tests.kengoro.viewer.small_window import read_event, wait_for


@pytest.fixture
def served() -> Iterator[tuple[Broadcast, PageServer]]:
    broadcast = Broadcast()
    server = PageServer(broadcast)
    yield broadcast, server
    server.close()


def ask(port: int, path: str, method: str = "GET", host: str = "127.0.0.1") -> tuple[int, str, Any]:
    """Status, body and headers of an answer."""
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as connection:
        connection.request(method, path, headers={"Host": f"{host}:{port}"})
        answer = connection.getresponse()
        return answer.status, answer.read().decode(), answer.headers


def test_the_page_is_all_that_is_served(served: tuple[Broadcast, PageServer]) -> None:
    port = served[1].port
    status, page, headers = ask(port, "/")
    assert status == 200
    assert "<h1" in page
    assert headers["Content-Security-Policy"].startswith("default-src 'none'")
    assert ask(port, "/", host="localhost")[0] == 200
    for path in ("/window.html", "/../pyproject.toml", "//etc/passwd", "/events/", "/?x"):
        assert ask(port, path)[0] == 404
    assert ask(port, "/", "POST")[0] == 501


def test_only_this_computer_is_answered(served: tuple[Broadcast, PageServer]) -> None:
    broadcast, server = served
    for path in ("/", "/events"):
        assert ask(server.port, path, host="elsewhere.example")[0] == 403
    assert broadcast.watchers == 0
    with socket.socket() as other:  # bound to one address: the port is free on the others
        other.bind(("127.0.0.2", server.port))


def test_the_stream_sends_what_is_new_and_the_panel_where_it_changed(
    served: tuple[Broadcast, PageServer],
) -> None:
    broadcast, server = served
    with urllib.request.urlopen(f"{server.address}events", timeout=10) as stream:
        found = []
        for number, panel in enumerate(("a", "a", "b")):
            broadcast.publish(Shown({"title": "<b>"}, f"scene {number}", panel))
            found.append(json.loads(read_event(stream).removeprefix("data: ")))
        assert found == [
            {"title": "<b>", "scene": "scene 0", "panel": "a"},
            {"title": "<b>", "scene": "scene 1"},
            {"title": "<b>", "scene": "scene 2", "panel": "b"},
        ]
        assert broadcast.watchers == 1
        broadcast.end()
        assert read_event(stream).startswith("event: end")
    wait_for(lambda: broadcast.watchers == 0)


def test_who_closes_the_page_is_forgotten(
    served: tuple[Broadcast, PageServer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kengoro.viewer.web.SILENCE", 0.05)
    broadcast, server = served
    with urllib.request.urlopen(f"{server.address}events", timeout=10):
        wait_for(lambda: broadcast.watchers == 1)
    wait_for(lambda: broadcast.watchers == 0)


def test_pictures_arrive_as_they_were() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    kind, text = data_url(picture, "png").split(",")
    assert kind == "data:image/png;base64"
    read = cv2.imdecode(np.frombuffer(base64.b64decode(text), np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(cv2.cvtColor(read, cv2.COLOR_BGR2RGB), picture)
