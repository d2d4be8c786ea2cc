"""Words: sentences and figures of the report in addition to its pictures."""

from __future__ import annotations

from reality_gap.diagnosis import Diagnosis, FittedCandidate, NamedCause, Verdict
from reality_gap.report.formatting import capital, human, joined, number, probability
from reality_gap.report.plots.candidates import as_likely, by_step

DOUBT = 0.05
"""Smallest probability of an unknown cause that the report mentions."""
LEAST = 0.01
"""Smallest probability of what lowers a confidence that the report mentions."""
KINDS = {
    Verdict.NOTHING_WRONG: "Nothing wrong was found",
    Verdict.NAMED: "Cause named",
    Verdict.PARTLY_NAMED: "Part of the error is explained",
    Verdict.UNEXPLAINED: "Something is wrong, and no known cause explains it",
}


def kind(verdict: Verdict) -> str:
    """Return the verdict in a few words."""
    return KINDS[verdict]


def figures(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """Return the numbers at the top of the page, each with its name and its meaning."""
    same = diagnosis.rms_after == diagnosis.rms_before
    before, after = number(diagnosis.rms_before), number(diagnosis.rms_after)
    models = "your model" if same else "your model and of the extended model"
    found = [
        (
            "Residual, held-out data",
            before if same else f"{before} → {after}",
            f"RMS of {models}, in units of the sensors' noise",
        ),
        ("Floor", number(diagnosis.noise_floor), "RMS that the noise alone would leave"),
    ]
    if diagnosis.causes:
        value = ", ".join(probability(cause.confidence) for cause in diagnosis.causes)
        each = "" if len(diagnosis.causes) == 1 else ", in the order of the causes"
        found.insert(0, ("Confidence", value, f"probability that the cause is right{each}"))
    if diagnosis.causes and diagnosis.gain is not None:
        gain = diagnosis.gain
        found.append(
            (
                "Gain",
                probability(gain.value),
                "of the error above the floor is removed; 95 % interval "
                f"{probability(gain.low)} to {probability(gain.high)}",
            )
        )
    return found


def about_restarts(diagnosis: Diagnosis) -> str:
    """Return a sentence on restarts of replays; empty if there were none."""
    if not diagnosis.restart:
        return ""
    return (
        "The motion amplifies errors of its state, so that no model predicts a whole log from its "
        f"begin: replays begin again from the readings every {number(diagnosis.restart)} s, and "
        "residuals are those within these parts."
    )


def about_notes(diagnosis: Diagnosis) -> str:
    """Return a sentence that refers to the notes of an unexplained gap; empty without notes."""
    count = len(diagnosis.notes or ())
    if diagnosis.verdict is not Verdict.UNEXPLAINED or not count:
        return ""
    what = "the note on the study above" if count == 1 else f"the {count} notes on the study above"
    return (
        f"Consider {what} first: an error of the study, such as a wrong sign, unit or column, is "
        "none of the causes."
    )


def why(diagnosis: Diagnosis) -> list[str]:
    """Return the reasons of the verdict: why causes are named in part only, or not at all."""
    if diagnosis.verdict.has_names:
        found = _unmodelled(diagnosis)
        missed = [one.objection for one in diagnosis.criteria if not one.met]
        if diagnosis.verdict is Verdict.PARTLY_NAMED and missed:
            found.insert(0, f"More is wrong than that: the extended model {missed[-1]}.")
        return found
    steps = by_step(diagnosis.fitted_candidates)
    return [_no_winner(diagnosis, steps[0])] if steps else []


def why_named(diagnosis: Diagnosis, cause: NamedCause) -> list[str]:
    """Return why a cause is named, as sentences."""
    found = [cause.candidate.cause.explanation]
    if log := cause.candidate.location.log:
        found.append(f"This acts in {log} only, in addition to what acts in all logs.")
    others = "" if len(diagnosis.causes) == 1 else ", in addition to the other named causes,"
    if cause.share is not None:
        taken = f"removes {probability(cause.share.fraction)} of the error above the noise"
        if cause.share.fraction < 0.0:
            taken = "does not make the RMS smaller, which the tolerances dominate"
        before = "" if cause is diagnosis.causes[0] else ", beside the causes before it"
        found.append(f"On held-out data it {taken}{before}.")
    if cause.gain is not None:
        found.append(
            f"It{others} makes readings to which it was not fitted more probable by "
            f"{number(cause.gain.value)} nats (95 % interval {number(cause.gain.low)} to "
            f"{number(cause.gain.high)})."
        )
    step = step_of(diagnosis, cause)
    rest = [f for f in step if not f.chosen and f.candidate.cause.id not in cause.equivalent]
    if rest and step[0].chosen:
        margin = step[0].evidence - rest[0].evidence
        nearly = as_likely(rest[0], step)
        found.append(
            f"{capital(_name(rest[0]))} is about as likely."
            if nearly
            else f"All data together make it more probable than the next candidate, "
            f"{_name(rest[0])}, by {number(margin)} nats."
        )
    if cause.equivalent:
        names = joined([human(id_) for id_ in sorted(cause.equivalent)], "or")
        found.append(f"These data cannot distinguish it from {names}.")
    if cause.elsewhere:
        elsewhere = joined([str(location) for location in cause.elsewhere], "or")
        found.append(f"It would have the same effect at {elsewhere}.")
    return [*found, *_doubts(cause)]


def step_of(diagnosis: Diagnosis, cause: NamedCause) -> list[FittedCandidate]:
    """Return the candidates that were tried in the place of a named cause, the cause first."""
    for step in by_step(diagnosis.fitted_candidates):
        if step[0].chosen and step[0].candidate.matches(cause.candidate):
            return step
    return []


def _no_winner(diagnosis: Diagnosis, step: list[FittedCandidate]) -> str:
    best = step[0]
    sentence = (
        f"Of {len(step)} candidates that were fitted, {_name(best)} has the most evidence, "
        f"{number(best.evidence)} nats. "
    )
    if diagnosis.verdict is Verdict.NOTHING_WRONG:
        return sentence + (
            "Logs of a machine without a fault have as much by chance, or it does not predict "
            "held-out data better, or other candidates do so, too; it is therefore not named."
        )
    return sentence + (
        "It explains a part of the error, as a wrong cause can, but does not meet the criteria for "
        "a name."
    )


def _unmodelled(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence if none of the known causes may be right."""
    chance = diagnosis.unmodelled or 0.0
    if chance < DOUBT:
        return []
    return [
        "A learned residual, which stands for unknown causes, explains about as much as the named "
        f"causes: with a probability of {probability(chance)} none of the known causes is right."
    ]


def _doubts(cause: NamedCause) -> list[str]:
    """Return a sentence on what lowers the confidence of a cause, if it is worth mentioning."""
    reasons = [
        f"{one.reason} ({probability(one.probability)})"
        for one in cause.doubts
        if one.probability >= LEAST
    ]
    if not reasons:
        return []
    confidence = probability(cause.confidence)
    return [f"Its confidence is {confidence}; the rest is that of {joined(reasons, 'or')}."]


def _name(fitted: FittedCandidate) -> str:
    return f"{fitted.candidate.cause.title} at {fitted.candidate.location}"
