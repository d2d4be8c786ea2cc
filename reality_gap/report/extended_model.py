"""Extended model: extended.xml, and extended.json with the effects that MuJoCo cannot express.

calibrated.xml and calibrated.json are the same with all numbers of the model adjusted.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import mujoco

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.extended import Effect, Extended
from reality_gap.report.verdict_json import location_json
from reality_gap.simulation.hypothesis import Part
from reality_gap.study.data import check_untrusted_model

XML, JSON = "extended.xml", "extended.json"
CALIBRATED_XML, CALIBRATED_JSON = "calibrated.xml", "calibrated.json"


def load_extended(folder: Path | str) -> Extended:
    """Load an extended model.

    Args:
        folder: the folder of a diagnosis.

    Raises:
        StudyError: the folder does not contain an extended model.
        UnknownNameError: the model needs a cause that is not in the catalogue.
    """
    return _load(Path(folder), XML, JSON, "give the folder of a diagnosis")


def load_calibrated(folder: Path | str) -> Extended:
    """Load a calibrated model: the extended one with all its numbers adjusted to the log.

    Args:
        folder: the folder of a diagnosis.

    Raises:
        StudyError: the folder does not contain a calibrated model. A diagnosis writes none if it
            would not predict better, and where nothing is wrong.
        UnknownNameError: the model needs a cause that is not in the catalogue.
    """
    advice = "give the folder of a diagnosis whose report mentions a calibrated model"
    return _load(Path(folder), CALIBRATED_XML, CALIBRATED_JSON, advice)


def _load(folder: Path, xml: str, effects_of: str, advice: str) -> Extended:
    path = folder / effects_of
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        effects = tuple(_effect(entry) for entry in content["effects"])
        named = content["model"]
    except FileNotFoundError as error:
        raise StudyError(f"no {effects_of} in {folder}; {advice}") from error
    except UnknownNameError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise StudyError(f"{path} was not written by a diagnosis: {error!r}") from error
    if named != xml:
        raise StudyError(f"{path} names the model {named!r} instead of {xml}")
    check_untrusted_model(folder / xml, folder)
    return Extended(mujoco.MjSpec.from_file(str(folder / xml)), effects)


def extension_json(parts: Iterable[Part], xml: str = XML) -> dict[str, Any]:
    """Return the content of extended.json: the causes with effects that the XML file lacks."""
    effects = (
        Effect(candidate.cause, candidate.location, dict(values)) for candidate, values in parts
    )
    return effects_json(effects, xml)


def effects_json(effects: Iterable[Effect], xml: str = XML) -> dict[str, Any]:
    """Return the content of extended.json for effects that the XML file lacks."""
    entries = [
        {
            "cause": effect.cause.id,
            **location_json(effect.location),
            "parameters": {name: float(value) for name, value in effect.values.items()},
        }
        for effect in effects
    ]
    return {"model": xml, "effects": entries}


def _effect(entry: dict[str, Any]) -> Effect:
    location = Location(entry["kind"], tuple(entry["elements"]), entry["note"])
    return Effect(find_cause(entry["cause"]), location, dict(entry["parameters"]))
