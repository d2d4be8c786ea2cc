"""Messages, and their bounds."""

from __future__ import annotations

import json

import numpy as np
import pytest

from kengoro.remote_robot.messages import (
    MAX_HEAD,
    Message,
    MessageError,
    MessageReader,
    encodable,
)


def with_head(text: str) -> bytes:
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def test_messages_arrive_in_any_pieces() -> None:
    messages = [Message({"kind": "a", "x": 1}, b"12345"), Message({"kind": "b"})]
    data = b"".join(message.encoded() for message in messages)
    reader = MessageReader(5)
    found = [message for k in range(len(data)) for message in reader.feed(data[k : k + 1])]
    assert [message.kind for message in found] == ["a", "b"]
    assert [message.body for message in found] == [b"12345", b""]
    assert [m.kind for m in MessageReader(5).feed(data)] == ["a", "b"]


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ((MAX_HEAD + 1).to_bytes(4, "big"), "a head of 65537 bytes"),
        (b"\0\0\0\0", "a head of 0 bytes"),
        (b"GET / HTTP/1.1\r\n", "a head of"),
        (with_head('{"bytes": 6}'), "a frame of 6 bytes; at most 5"),
        (with_head('{"bytes": -1}'), "'bytes' must be an integer"),
        (with_head("{}"), "'bytes' must be an integer"),
        (with_head("[" * 50_000), "not JSON"),
        (with_head("9" * 5000), "not JSON"),
        (with_head('"text"'), "not a JSON object"),
        (b"\0\0\0\1\xff", "not JSON"),
    ],
)
def test_what_is_no_message_is_refused_before_it_is_kept(data: bytes, sentence: str) -> None:
    with pytest.raises(MessageError, match=sentence):
        MessageReader(5).feed(data)


@pytest.mark.parametrize(
    "value",
    [None, "1", {}, [1.0], [1.0, None], [1.0, "2"], [1.0, True], [1.0, [2.0]], [1.0, 10**400]],
)
def test_what_is_no_list_of_numbers_is_refused(value: object) -> None:
    with pytest.raises(MessageError, match="entry 'x' must be"):
        Message({"kind": "a", "x": value}).numbers("x", 2)


@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_not_finite_are_refused(text: str) -> None:
    head = json.loads(f'{{"x": [{text}, 0], "y": {text}}}')
    for gaps in (False, True):
        if gaps and text == "NaN":
            continue  # a length that was not measured
        with pytest.raises(MessageError, match="finite"):
            Message(head).numbers("x", 2, gaps)
    with pytest.raises(MessageError, match="finite"):
        Message(head).number("y")


def test_numbers_keep_their_bits_and_gaps() -> None:
    numbers = np.array([1.0 / 3.0, np.nan, -0.0, 1.7e9 + 0.02])
    sent = Message({"x": encodable(numbers)}).encoded()
    [message] = MessageReader().feed(sent)
    np.testing.assert_array_equal(message.numbers("x", 4, gaps=True), numbers)


@pytest.mark.parametrize("shape", [[2, 2], [2, 2, 1], [0, 2, 3], [1.0, 2, 3], [2, 2, 3], "wide"])
def test_frames_that_are_none_are_refused(shape: object) -> None:
    with pytest.raises(MessageError, match="frame"):
        Message({"frame": shape}, bytes(6)).frame()
