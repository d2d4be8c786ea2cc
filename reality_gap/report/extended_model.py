"""Extended model: extended.xml, and extended.json with the effects that MuJoCo cannot express."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco

from reality_gap.causes import find_cause
from reality_gap.causes.base import Cause, Effects, Location
from reality_gap.diagnosis import Diagnosis
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.report.verdict_json import location_json
from reality_gap.simulation.hypothesis import Plant
from reality_gap.simulation.inverse_dynamics import ensure_prepared, inverse_replay
from reality_gap.simulation.replay import Replay, replay
from reality_gap.study.data import Study, check_untrusted_model
from reality_gap.study.measurements import measured
from reality_gap.study.system import compile_system

XML, JSON = "extended.xml", "extended.json"


@dataclass(frozen=True)
class Effect:
    """A cause that acts in addition to the model.

    Attributes:
        cause: the mechanism.
        location: where it acts.
        values: values of its parameters in SI units.
    """

    cause: Cause
    location: Location
    values: dict[str, float]


@dataclass(frozen=True)
class Extended:
    """A model that was extended by the named causes.

    Attributes:
        spec: model of extended.xml; must not be edited.
        effects: causes that act in addition to it.
    """

    spec: mujoco.MjSpec
    effects: tuple[Effect, ...]

    def plant(self, study: Study) -> Plant:
        """Return the extended plant for a study of the diagnosed model.

        Raises:
            UnknownNameError: an effect acts on an element that the study's model does not have.
        """
        system, effects = compile_system(study), Effects()
        for effect in self.effects:
            _check_location(effect.location, study)
            if effect.cause.attach is not None:
                effect.cause.attach(effects, system, effect.location, effect.values)
        return Plant(self.spec.copy(), effects)

    def replay(self, study: Study) -> Replay:
        """Replay a study with the extended model.

        Raises:
            UnknownNameError: see `plant`.
        """
        study = ensure_prepared(study)
        run = inverse_replay if study.inverse else replay
        return run(self.plant(study), study, measured(study))


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
    effects = [
        {
            "cause": candidate.cause.id,
            **location_json(candidate.location),
            "parameters": {name: float(value) for name, value in values.items()},
        }
        for candidate, values in diagnosis.effects
    ]
    return {"model": XML, "effects": effects}


def _effect(entry: dict[str, Any]) -> Effect:
    location = Location(entry["kind"], tuple(entry["elements"]), entry["note"])
    return Effect(find_cause(entry["cause"]), location, dict(entry["parameters"]))


def _check_location(location: Location, study: Study) -> None:
    known = list(_names(location.kind, study.spec()))
    for name in location.elements:
        if location.kind != "model" and name not in known:
            raise UnknownNameError(f"{location.kind} of the study's model", name, known)


def _names(kind: str, spec: mujoco.MjSpec) -> Iterable[str]:
    plural = {"body": "bodies"}.get(kind, f"{kind}s")
    return (element.name for element in getattr(spec, plural, ()))
