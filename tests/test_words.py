"""One word for each concept, in identifiers, keys of JSON and command-line options.

`INSTEAD` lists words that these may not hold, with the field's word for each. Prose is read by
people.
"""

from __future__ import annotations

import ast
import io
import json
import keyword
import re
import subprocess
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]

INSTEAD = {
    "suspect": "candidate",
    "newcomer": "candidate",
    "rival": "candidate, hypothesis",
    "workbench": "replayer",
    "ruler": "noise model, likelihood",
    "shelf": "checkpoint",
    "spot": "elements",
    "place": "elements",
    "nameless": "unmodelled",
    "look": "marker observation",
    "sight": "marker residual",
    "sense": "sensor readings",
    "felt": "sensor readings, observation",
    "knock": "external disturbance",
    "floors": "detection limits",
    "examination": "evaluation",
    "examine": "evaluate",
    "unseen": "observability",
    "waviness": "roughness",
    "wavy": "rough",
    "gives": "permanent elongation",
    "gave": "permanent elongation",
    "giving": "permanent elongation",
    "heldback": "hold-out",
    "way": "trajectory, direction",
    "drawn": "nominal; sampled",
    "mind": "agent",
    "eyes": "marker detector",
    "thing": "object",
    "told": "result",
    "tell": "progress callback",
    "say": "progress callback",
    "said": "message, result",
    "fence": "sandbox",
    "child": "worker",
    "orphan": "parent watchdog",
    "car": "what the helper makes",
    "painting": "what the helper makes",
    "making": "what the helper makes",
    "everything": "all",
    "freed": "free-parameter baseline",
    "anew": "recompute",
    "wire": "muscle at interfaces, tendon in MuJoCo code",
    "whom": "candidate",
    "nobody": "none",
}
ALLOWED = {
    "wire_elongation",  # the id of a cause, which people have in their files
    "wire-snaps",  # the name of an experiment
    "wire_snaps",
    "childclass",  # an attribute of MJCF
    "child_frame_id",  # a field of ROS messages
    "after_in_child",  # an argument of os.register_at_fork
}
PLURALS = {"senses": "sense", "ways": "way", "wires": "wire", "says": "say", "tells": "tell"}


def words(name: str) -> set[str]:
    """The words of a name in snake or camel case, in lower case and the singular."""
    parts = re.findall(
        r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+", name.replace("held_back", "heldback")
    )
    found = {part.lower() for part in parts}
    return found | {PLURALS.get(word, word.removesuffix("s")) for word in found}


def names(source: str) -> set[str]:
    """Identifiers of Python source, and strings that look like keys."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    found = {
        t.string for t in tokens if t.type == tokenize.NAME and not keyword.iskeyword(t.string)
    }
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.update(re.findall(r"^-*[A-Za-z][\w-]*$", node.value))
    return found


def tracked(*patterns: str) -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return [ROOT / line for line in listed.stdout.splitlines()]


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("each_wire", {"wire"}),
        ("HeldBackOptions", {"heldback"}),
        ("SensesLog", {"sense"}),
        ("placement", set()),
        ("DIVERGED", set()),
        ("everythingElse", {"everything"}),
    ],
)
def test_words_of_names(name: str, found: set[str]) -> None:
    assert words(name.replace("HeldBack", "held_back")) & set(INSTEAD) == found


def forbidden(found: set[str]) -> list[str]:
    """Names that hold a forbidden word."""
    return sorted(name for name in found - ALLOWED if words(name) & set(INSTEAD))


def keys(content: Any) -> Iterator[str]:
    """Keys of JSON that are names, at any depth."""
    if isinstance(content, dict):
        yield from (key for key in content if re.fullmatch(r"[A-Za-z]\w*", key))
        content = list(content.values())
    if isinstance(content, list):
        for part in content:
            yield from keys(part)


def test_identifiers_and_keys_in_python_have_the_words_of_the_field() -> None:
    own = Path(__file__)
    found = {
        path.relative_to(ROOT).as_posix(): forbidden(names(path.read_text(encoding="utf-8")))
        for path in tracked("*.py")
        if path != own and path.exists()
    }
    assert not {path: bad for path, bad in found.items() if bad}


def test_keys_of_json_have_the_words_of_the_field() -> None:
    found = {
        path.relative_to(ROOT).as_posix(): forbidden(
            set(keys(json.loads(path.read_text(encoding="utf-8"))))
        )
        for path in tracked("*.json")
    }
    assert not {path: bad for path, bad in found.items() if bad}


def test_options_in_the_documentation_have_the_words_of_the_field() -> None:
    pages = "\n".join(path.read_text(encoding="utf-8") for path in tracked("*.md", "Makefile"))
    assert not forbidden(set(re.findall(r"(?<![\w-])--[a-z][\w-]*", pages)))


def test_a_forbidden_word_is_found() -> None:
    assert forbidden(names("def f(the_ruler): return {'all-suspects': the_ruler}")) == [
        "all-suspects",
        "the_ruler",
    ]
    assert forbidden(set(keys([{"a": {"held_back": 1}}]))) == ["held_back"]
