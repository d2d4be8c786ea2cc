"""verdict.json: what a diagnosis says, for programs."""

from __future__ import annotations

import math
from typing import Any

from reality_gap.causes.base import Location
from reality_gap.diagnosis import Diagnosis, Estimate, Experiment, FittedCandidate, Gain, NamedCause

Json = dict[str, Any]


def verdict_json(diagnosis: Diagnosis) -> Json:
    """A diagnosis as JSON, in SI units; keys are part of the interface.

    Raises:
        ValueError: a number is not finite. Only a rival's score may be so, and is null then.
    """
    content = {
        "verdict": diagnosis.verdict.value,
        "sentence": diagnosis.sentence,
        "causes": [_cause(cause) for cause in diagnosis.causes],
        "unmodelled": diagnosis.unmodelled,
        "rms_before": diagnosis.rms_before,
        "rms_after": diagnosis.rms_after,
        "noise_floor": diagnosis.noise_floor,
        "gain": _gain(diagnosis.gain),
        "likelihood_gain": _gain(diagnosis.likelihood_gain),
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
        "candidates": [
            _fitted_candidate(fitted_candidate) for fitted_candidate in diagnosis.fitted_candidates
        ],
        "study": diagnosis.study,
        "seconds": diagnosis.seconds,
    }
    plain: Json = _plain(content, "")
    return plain


def _gain(gain: Gain | None) -> Json | None:
    return None if gain is None else {"value": gain.value, "low": gain.low, "high": gain.high}


def location_json(location: Location) -> Json:
    """Where a cause acts, by names in the model."""
    return {"kind": location.kind, "elements": list(location.elements), "note": location.note}


def _cause(cause: NamedCause) -> Json:
    return {
        "cause": cause.candidate.cause.id,
        **location_json(cause.candidate.location),
        "parameters": {name: _estimate(value) for name, value in cause.parameters.items()},
        "confidence": cause.confidence,
        "equivalent": list(cause.equivalent),
        "elsewhere": [location_json(location) for location in cause.elsewhere],
    }


def _estimate(estimate: Estimate) -> Json:
    return {
        "value": estimate.value,
        "low": estimate.low,
        "high": estimate.high,
        "unit": estimate.unit,
    }


def _fitted_candidate(fitted_candidate: FittedCandidate) -> Json:
    return {
        "cause": fitted_candidate.candidate.cause.id,
        **location_json(fitted_candidate.candidate.location),
        "values": dict(fitted_candidate.values),
        "score": fitted_candidate.score if math.isfinite(fitted_candidate.score) else None,
        "confidence": fitted_candidate.confidence,
        "step": fitted_candidate.step,
        "chosen": fitted_candidate.chosen,
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
