"""One word a thing: the private vocabulary of the first year stays out of names, keys and options.

Prose is read by people. Here are the words that identifiers, keys of JSON and command-line options
may not hold, with the field's word for each.
"""

from __future__ import annotations

import ast
import io
import keyword
import re
import subprocess
import tokenize
from pathlib import Path

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
    "childclass",  # an attribute of MJCF
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
def test_words_are_told_apart(name: str, found: set[str]) -> None:
    assert words(name.replace("HeldBack", "held_back")) & set(INSTEAD) == found
