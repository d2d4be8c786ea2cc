"""Extended model: extended.xml, and extended.json with the effects that MuJoCo cannot express."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import mujoco

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location
from reality_gap.diagnosis import Diagnosis
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.extended import Effect, Extended
from reality_gap.report.verdict_json import location_json
from reality_gap.study.data import check_untrusted_model

XML, JSON = "extended.xml", "extended.json"


def load_extended(folder: Path | str) -> Extended:
    """Load an extended model.

    Args:
        folder: the folder of a diagnosis.

    Raises:
        StudyError: the folder does not contain an extended model.
        UnknownNameError: the model needs a cause that is not in the catalogue.
    """
    folder = Path(folder)
    path = folder / JSON
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        effects = tuple(_effect(entry) for entry in content["effects"])
        named = content["model"]
    except FileNotFoundError as error:
        raise StudyError(f"no {JSON} in {folder}; give the folder of a diagnosis") from error
    except UnknownNameError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise StudyError(f"{path} was not written by a diagnosis: {error!r}") from error
    if named != XML:
        raise StudyError(f"{path} names the model {named!r} instead of {XML}")
    check_untrusted_model(folder / XML, folder)
    return Extended(mujoco.MjSpec.from_file(str(folder / XML)), effects)


def extension_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the content of extended.json: the causes with effects that extended.xml lacks."""
    return effects_json(
        Effect(candidate.cause, candidate.location, dict(values))
        for candidate, values in diagnosis.effects
    )


def effects_json(effects: Iterable[Effect]) -> dict[str, Any]:
    """Return the content of extended.json for effects that extended.xml lacks."""
    entries = [
        {
            "cause": effect.cause.id,
            **location_json(effect.location),
            "parameters": {name: float(value) for name, value in effect.values.items()},
        }
        for effect in effects
    ]
    return {"model": XML, "effects": entries}


def _effect(entry: dict[str, Any]) -> Effect:
    location = Location(entry["kind"], tuple(entry["elements"]), entry["note"])
    return Effect(find_cause(entry["cause"]), location, dict(entry["parameters"]))
