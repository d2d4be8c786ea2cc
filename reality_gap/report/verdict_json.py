"""verdict.json: a diagnosis for programs, with all numbers in SI units.

Keys of the file, which are part of the interface:

    verdict               "nothing_wrong", "named", "partly_named" or "unexplained"
    sentence              the verdict in words
    notes                 what is suspicious in the study, as sentences: the command check prints
                          the same; often the reason of an "unexplained" gap
    causes                named causes, the one that explains most first; empty unless "named" or
                          "partly_named":
        cause             id in the catalogue
        kind, elements, note
                          location: kind of the model elements, their names, and a note that
                          distinguishes locations with the same elements
        log               the only log in which the cause acts, in addition to what acts in all
                          logs; absent if it acts in all
        parameters        by name: value, low, high (95 % interval), unit
        confidence        probability that the cause is right
        doubts            what lowers the confidence, the likeliest first: reason, probability;
                          these and the confidence add up to 1
        equivalent        ids of causes that these data cannot distinguish from it
        elsewhere         list of other locations (kind, elements, note) where the same cause would
                          have the same effect
        held_out_gain     increase of the log likelihood of readings to which it was not fitted,
                          over the other named causes alone [nats]: value, low, high; or null
        share             what it removes from the error of held-out data, beside the causes
                          before it, as in "waterfall"; or null
        logs              null if there is one log; or else agreement ("same", "changed" or
                          "unknown"), chance (probability of such differences if it is the same, or
                          null), and values: log, and parameters by name as above, without those
                          that do not show in this log
    waterfall             what tolerances and causes remove from the error of held-out data, one
                          after the other: part, before, after [noise deviations], fraction of the
                          power above the noise
    rejected              causes of the best attempt that are not named: cause, kind, elements,
                          note, values by name, reason, held_out_gain
    criteria              comparisons on which the verdict was decided: name, value, threshold, met,
                          objection
    measures              numbers of the search and of what its causes leave, by name
    unmodelled            probability that unknown causes have the effect of all causes; null if
                          none was found; "doubts" hold what lowers the confidence of each cause
    rms_before            RMS of the residual of the model on held-out data, in noise deviations
    rms_after             the same for the extended model
    restart               longest time between two moments at which replays began again as the
                          readings show the state, 0 if they did not [s]
    calibration           the extended model with all its numbers adjusted, in calibrated.xml; null
                          if that does not predict better:
        rms               RMS of its residual on held-out data, in noise deviations
        corrections       the adjustments, the largest first; none of them is a finding: cause,
                          kind, elements, note, parameter, value, unit, tolerances
        together          whether gains, friction, damping, masses and the like were fitted
                          together in place of the named causes, which left too much
    noise_floor           RMS that the noise alone would leave
    gain                  (before - after) / (before - floor): value, low, high; null if uncertain
    likelihood_gain       increase of the log likelihood of readings to which the causes were not
                          fitted [nats]: value, low, high; or null
    unexplained_fraction  share of the error above the noise that the causes leave, 0 to 1; if
                          "nothing_wrong", what deviations within the tolerances leave; on all
                          data if held-out data show nothing of the causes, as of a short push
    explainable_fraction  share that the causes and a learned residual would explain, 0 to 1; if
                          "nothing_wrong", at least what these deviations do
    depends_on            what the remaining error depends on: quantity, channel, fraction
    next_experiment       title, sentence, commands (name of a file), separation, separation_before
                          [noise deviations]; or null
    not_judged            causes that this log says nothing about: cause, reason
    flat                  what this log cannot show, by location:
        candidates        cause, kind, elements, note of each
        separable         true if none of them shows, false if it does not show which of them it is
        change            effect of a typical fault, or distance of two candidates [noise
                          deviations]
        tried             whether a remedy was looked for
        remedy            motion, seconds, mass [kg], body, change [noise deviations]; or null
    candidates            all fitted candidates, best first in each step of the search: cause, kind,
                          elements, note, values by name, score [nats] or null if the replay
                          diverges, evidence [nats], confidence, step, chosen
    study                 name of the study
    seconds               computing time [s]
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from reality_gap.causes.base import Location
from reality_gap.diagnosis import (
    Calibration,
    Criterion,
    Diagnosis,
    Estimate,
    Experiment,
    FittedCandidate,
    Gain,
    NamedCause,
    Rejected,
    Share,
)
from reality_gap.log_findings import FlatDirection, LogComparison

Json = dict[str, Any]


def verdict_json(diagnosis: Diagnosis) -> Json:
    """Return the content of verdict.json.

    Raises:
        ValueError: a number is not finite, except for the score of a candidate, which then is null.
    """
    content = {
        "verdict": diagnosis.verdict.value,
        "sentence": diagnosis.sentence,
        "notes": list(diagnosis.notes or ()),
        "causes": [_cause(cause) for cause in diagnosis.causes],
        "waterfall": [_share(step) for step in diagnosis.waterfall],
        "rejected": [_rejected(one) for one in diagnosis.rejected],
        "criteria": [_criterion(one) for one in diagnosis.criteria],
        "measures": dict(diagnosis.measures),
        "unmodelled": diagnosis.unmodelled,
        "rms_before": diagnosis.rms_before,
        "rms_after": diagnosis.rms_after,
        "calibration": _calibration(diagnosis.calibration),
        "restart": diagnosis.restart,
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
        "flat": [_flat(one) for one in diagnosis.flat],
        "candidates": [_candidate(fitted) for fitted in diagnosis.fitted_candidates],
        "study": diagnosis.study,
        "seconds": diagnosis.seconds,
    }
    plain: Json = _plain(content, "")
    return plain


def location_json(location: Location) -> Json:
    """Return the keys of a location."""
    found = {"kind": location.kind, "elements": list(location.elements), "note": location.note}
    return found | {"log": location.log} if location.log else found


def _calibration(calibration: Calibration | None) -> Json | None:
    if calibration is None:
        return None
    corrections = [
        {
            "cause": one.candidate.cause.id,
            **location_json(one.candidate.location),
            "parameter": one.parameter.name,
            "value": one.value,
            "unit": one.parameter.unit,
            "tolerances": one.tolerances,
        }
        for one in calibration.corrections
    ]
    together = calibration.together
    return {"rms": calibration.rms, "corrections": corrections, "together": together}


def _gain(gain: Gain | None) -> Json | None:
    return None if gain is None else {"value": gain.value, "low": gain.low, "high": gain.high}


def _cause(cause: NamedCause) -> Json:
    return {
        "cause": cause.candidate.cause.id,
        **location_json(cause.candidate.location),
        "parameters": {name: _estimate(value) for name, value in cause.parameters.items()},
        "confidence": cause.confidence,
        "doubts": [{"reason": d.reason, "probability": d.probability} for d in cause.doubts],
        "equivalent": list(cause.equivalent),
        "elsewhere": [location_json(location) for location in cause.elsewhere],
        "held_out_gain": _gain(cause.gain),
        "share": None if cause.share is None else _share(cause.share),
        "logs": None if cause.logs is None else _logs(cause.logs),
    }


def _logs(compared: LogComparison) -> Json:
    return {
        "agreement": compared.agreement,
        "chance": compared.chance,
        "values": [
            {
                "log": value.log,
                "parameters": {name: _estimate(one) for name, one in value.parameters.items()},
            }
            for value in compared.values
        ],
    }


def _flat(one: FlatDirection) -> Json:
    return {
        "candidates": [
            {"cause": candidate.cause.id, **location_json(candidate.location)}
            for candidate in one.candidates
        ],
        "separable": one.separable,
        "change": one.change,
        "tried": one.tried,
        "remedy": None if one.remedy is None else asdict(one.remedy),
    }


def _share(step: Share) -> Json:
    return {
        "part": step.part,
        "before": step.before,
        "after": step.after,
        "fraction": step.fraction,
    }


def _rejected(one: Rejected) -> Json:
    return {
        "cause": one.candidate.cause.id,
        **location_json(one.candidate.location),
        "values": dict(one.values),
        "reason": one.reason,
        "held_out_gain": _gain(one.gain),
    }


def _criterion(one: Criterion) -> Json:
    return {
        "name": one.name,
        "value": one.value,
        "threshold": one.threshold,
        "met": one.met,
        "objection": one.objection,
    }


def _estimate(estimate: Estimate) -> Json:
    return {
        "value": estimate.value,
        "low": estimate.low,
        "high": estimate.high,
        "unit": estimate.unit,
    }


def _candidate(fitted: FittedCandidate) -> Json:
    return {
        "cause": fitted.candidate.cause.id,
        **location_json(fitted.candidate.location),
        "values": dict(fitted.values),
        "score": fitted.score if math.isfinite(fitted.score) else None,
        "evidence": fitted.evidence,
        "confidence": fitted.confidence,
        "step": fitted.step,
        "chosen": fitted.chosen,
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


def _plain(value: Any, key: str) -> Any:
    """Convert NumPy's numbers to Python's, and check that they are finite."""
    if isinstance(value, dict):
        return {name: _plain(item, f"{key}.{name}") for name, item in value.items()}
    if isinstance(value, list):
        return [_plain(item, f"{key}[{i}]") for i, item in enumerate(value)]
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, int):
        return int(value)
    if not math.isfinite(value):
        raise ValueError(f"verdict{key} is {value}, but must be finite")
    return float(value)
