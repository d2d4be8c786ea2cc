"""verdict.json: what a diagnosis says, for programs."""

from __future__ import annotations

import math
from typing import Any

from reality_gap.diagnosis import Diagnosis, Estimate, Experiment, NamedCause, Rival
from reality_gap.simulation.hypothesis import Suspect

Json = dict[str, Any]


def verdict_json(diagnosis: Diagnosis) -> Json:
    """A diagnosis as JSON, in SI units; keys are part of the interface.

    Raises:
        ValueError: a number is not finite. Only a rival's score may be so, and is null then.
    """
    gain = diagnosis.gain
    content = {
        "verdict": diagnosis.verdict.value,
        "sentence": diagnosis.sentence,
        "causes": [_cause(cause) for cause in diagnosis.causes],
        "nameless": diagnosis.nameless,
        "rms_before": diagnosis.rms_before,
        "rms_after": diagnosis.rms_after,
        "noise_floor": diagnosis.noise_floor,
        "gain": None if gain is None else {"value": gain.value, "low": gain.low, "high": gain.high},
        "unexplained_fraction": diagnosis.unexplained_fraction,
        "explainable_fraction": diagnosis.explainable_fraction,
        "depends_on": [
            {"quantity": d.quantity, "channel": d.channel, "fraction": d.fraction}
            for d in diagnosis.depends_on
        ],
        "next_experiment": _experiment(diagnosis.next_experiment),
        "not_judged": [
            {"cause": cause, "reason": reason} for cause, reason in diagnosis.not_judged
        ],
        "rivals": [_rival(rival) for rival in diagnosis.rivals],
        "study": diagnosis.study,
        "seconds": diagnosis.seconds,
    }
    plain: Json = _plain(content, "")
    return plain


def place_json(suspect: Suspect) -> Json:
    """Where a suspect acts, by names in the model."""
    place = suspect.place
    return {"kind": place.kind, "elements": list(place.elements), "note": place.note}


def _where(suspect: Suspect) -> Json:
    place = suspect.place
    return {"where": list(place.elements), "kind": place.kind, "note": place.note}


def _cause(cause: NamedCause) -> Json:
    return {
        "cause": cause.suspect.cause.id,
        **_where(cause.suspect),
        "parameters": {name: _estimate(value) for name, value in cause.parameters.items()},
        "confidence": cause.confidence,
        "equivalent": list(cause.equivalent),
    }


def _estimate(estimate: Estimate) -> Json:
    return {
        "value": estimate.value,
        "low": estimate.low,
        "high": estimate.high,
        "unit": estimate.unit,
    }


def _rival(rival: Rival) -> Json:
    return {
        "cause": rival.suspect.cause.id,
        **_where(rival.suspect),
        "values": dict(rival.values),
        "score": rival.score if math.isfinite(rival.score) else None,
        "confidence": rival.confidence,
        "step": rival.step,
        "chosen": rival.chosen,
    }


def _experiment(experiment: Experiment | None) -> Json | None:
    if experiment is None:
        return None
    return {
        "title": experiment.title,
        "sentence": experiment.sentence,
        "commands": "next_experiment.csv",
        "separation": experiment.separation,
        "separation_before": experiment.separation_before,
    }


def _plain(value: Any, where: str) -> Any:
    """Numbers of numpy as Python's; all of them finite."""
    if isinstance(value, dict):
        return {key: _plain(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item, f"{where}[{i}]") for i, item in enumerate(value)]
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, int):
        return int(value)
    if not math.isfinite(value):
        raise ValueError(f"verdict{where} is {value}, which is no result")
    return float(value)
