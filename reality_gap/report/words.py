"""Words: sentences and figures of the report in addition to its pictures."""

from __future__ import annotations

from reality_gap.diagnosis import Diagnosis, FittedCandidate, NamedCause, Verdict
from reality_gap.report.formatting import capital, human, joined, number, percent, probability
from reality_gap.report.plots.candidates import by_step, equivalents

DOUBT = 0.05
"""Smallest probability of an unknown cause that the report mentions."""
KINDS = {
    Verdict.NOTHING_WRONG: "Nothing wrong was found",
    Verdict.NAMED: "Cause named",
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
                percent(gain.value),
                "of the error above the floor is removed; 95 % interval "
                f"{percent(gain.low)} to {percent(gain.high)}",
            )
        )
    return found


def why(diagnosis: Diagnosis) -> list[str]:
    """Return the reasons of the verdict, one sentence for each named cause."""
    steps = by_step(diagnosis.fitted_candidates)
    if diagnosis.verdict is Verdict.NAMED:
        others = "" if len(steps) == 1 else ", in addition to the other causes of the verdict,"
        return [_winner(step, diagnosis.causes, others) for step in steps] + _unmodelled(diagnosis)
    return [_no_winner(diagnosis, steps[0])] if steps else []


def _no_winner(diagnosis: Diagnosis, step: list[FittedCandidate]) -> str:
    best = step[0]
    sentence = (
        f"Of {len(step)} candidates that were fitted, {_name(best)} has the best score, "
        f"{number(best.score)} nats. "
    )
    if diagnosis.verdict is Verdict.NOTHING_WRONG:
        return sentence + (
            "Logs of a machine without a fault have such scores by chance, so that it is not named."
        )
    return sentence + (
        "It explains a part of the error, as a wrong cause can, and leaves too much of it to be "
        "named."
    )


def _winner(step: list[FittedCandidate], causes: tuple[NamedCause, ...], others: str) -> str:
    winner = next((fitted for fitted in step if fitted.chosen), step[0])
    alike = equivalents(step, causes)
    sentence = (
        f"{capital(_name(winner))}{others} predicts data to which it was not fitted better than "
        f"your model does, by {number(winner.score)} nats"
    )
    rest = [f for f in step if not f.chosen and f.candidate.cause.id not in alike]
    if rest:
        margin = winner.score - rest[0].score
        better = f"{number(margin)} nats better than" if margin > 0.0 else "not better than"
        sentence += f", and {better} the next candidate, {_name(rest[0])}"
        if margin <= 0.0:
            sentence += "; all data together still make it more probable"
    if alike:
        names = joined([human(id_) for id_ in sorted(alike)], "or")
        sentence += f". These data cannot distinguish it from {names}"
    return sentence + "."


def _unmodelled(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence if none of the known causes may be right."""
    chance = diagnosis.unmodelled or 0.0
    if chance < DOUBT:
        return []
    return [
        "A learned residual, which stands for unknown causes, explains about as much as the named "
        f"causes: with a probability of {probability(chance)} none of the known causes is right."
    ]


def _name(fitted: FittedCandidate) -> str:
    return f"{fitted.candidate.cause.title} at {fitted.candidate.location}"
