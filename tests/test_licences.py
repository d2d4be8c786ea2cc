"""Adapted material: NOTICE, CITATION.cff and the model itself name it with links and licences."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]

MATERIAL = {
    "https://simtk.org/projects/thoracoscapular": "https://creativecommons.org/licenses/by/4.0/",
    "https://github.com/opensim-org/opensim-models": "https://creativecommons.org/licenses/by/3.0/",
}
"""Links to the works that the arm is adapted from, and to their licences."""


@pytest.mark.parametrize("name", ["NOTICE", "assets/mjcf/kengoro_arm/arm.xml", "CITATION.cff"])
def test_adapted_material_is_named_with_its_licence(name: str) -> None:
    text = (ROOT / name).read_text("utf-8")
    for link, licence in MATERIAL.items():
        assert link in text
        assert licence in text
    assert "Seth" in text
    assert "Holzbaur" in text


def test_citation_lists_the_licence_of_each_adapted_work() -> None:
    references = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))["references"]
    data = [one for one in references if one["type"] == "data"]
    assert {one["license"] for one in data} == {"CC-BY-4.0", "CC-BY-3.0"}
    assert all(one["url"].startswith(tuple(MATERIAL)) and one["authors"] for one in data)


def test_the_elbow_carries_the_attribution_of_the_arm() -> None:
    text = (ROOT / "assets/mjcf/kengoro_arm/elbow.xml").read_text("utf-8")
    assert "CC BY 4.0" in text
    assert "CC BY 3.0" in text
