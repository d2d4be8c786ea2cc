"""The web server of the page: who may request what, and when the stream sends new content."""

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

from kengoro.viewer.web import Broadcast, PageContent, PageServer, data_url
from tests.kengoro.viewer.page_clients import read_event, wait_for


@pytest.fixture
def broadcast_and_server() -> Iterator[tuple[Broadcast, PageServer]]:
    broadcast = Broadcast()
    server = PageServer(broadcast)
    yield broadcast, server
    server.close()


def request(
    port: int, path: str, method: str = "GET", host: str = "127.0.0.1"
) -> tuple[int, str, Any]:
    """Status, body and headers of the response."""
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as connection:
        connection.request(method, path, headers={"Host": f"{host}:{port}"})
        response = connection.getresponse()
        return response.status, response.read().decode(), response.headers


def test_only_the_page_is_served(broadcast_and_server: tuple[Broadcast, PageServer]) -> None:
    port = broadcast_and_server[1].port
    status, page, headers = request(port, "/")
    assert status == 200
    assert "<h1" in page
    assert headers["Content-Security-Policy"].startswith("default-src 'none'")
    assert request(port, "/", host="localhost")[0] == 200
    for path in ("/window.html", "/../pyproject.toml", "//etc/passwd", "/events/", "/?x"):
        assert request(port, path)[0] == 404
    assert request(port, "/", "POST")[0] == 501


def test_only_requests_from_this_computer_are_served(
    broadcast_and_server: tuple[Broadcast, PageServer],
) -> None:
    broadcast, server = broadcast_and_server
    for path in ("/", "/events"):
        assert request(server.port, path, host="elsewhere.example")[0] == 403
    assert broadcast.watchers == 0
    with socket.socket() as other:  # bound to one address: the port is free on the others
        other.bind(("127.0.0.2", server.port))


def test_the_stream_sends_new_content_and_the_panel_only_if_it_changed(
    broadcast_and_server: tuple[Broadcast, PageServer],
) -> None:
    broadcast, server = broadcast_and_server
    with urllib.request.urlopen(f"{server.address}events", timeout=10) as stream:
        found = []
        for number, panel in enumerate(("a", "a", "b")):
            broadcast.publish(PageContent({"title": "<b>"}, f"scene {number}", panel))
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


def test_a_page_that_was_closed_is_not_counted_any_more(
    broadcast_and_server: tuple[Broadcast, PageServer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kengoro.viewer.web.TIMEOUT", 0.05)
    broadcast, server = broadcast_and_server
    with urllib.request.urlopen(f"{server.address}events", timeout=10):
        wait_for(lambda: broadcast.watchers == 1)
    wait_for(lambda: broadcast.watchers == 0)


def test_a_png_data_url_holds_the_picture_unchanged() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    kind, text = data_url(picture, "png").split(",")
    assert kind == "data:image/png;base64"
    read = cv2.imdecode(np.frombuffer(base64.b64decode(text), np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(cv2.cvtColor(read, cv2.COLOR_BGR2RGB), picture)
