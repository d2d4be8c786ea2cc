"""What a diagnosis says in words, beside its pictures."""

from __future__ import annotations

from reality_gap.diagnosis import Diagnosis, FittedCandidate, NamedCause, Verdict
from reality_gap.report.formatting import capital, human, joined, number, percent
from reality_gap.report.plots.candidates import by_step, equivalents

DOUBT = 0.05
"""Probability from which on it is said that the cause may have no name."""
KINDS = {
    Verdict.NOTHING_WRONG: "Nothing wrong was found",
    Verdict.NAMED: "Cause named",
    Verdict.UNEXPLAINED: "Something is wrong, and no known cause explains it",
}


def kind(verdict: Verdict) -> str:
    """The verdict in a few words."""
    return KINDS[verdict]


def figures(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """The numbers at the top of the page: name, number, what it means."""
    same = diagnosis.rms_after == diagnosis.rms_before
    before, after = number(diagnosis.rms_before), number(diagnosis.rms_after)
    models = "your model" if same else "your model, and with the extended one"
    found = [
        (
            "Residual, held-out data",
            before if same else f"{before} → {after}",
            f"RMS with {models}, in units of the sensors' noise",
        ),
        ("Floor", number(diagnosis.noise_floor), "what the noise alone would leave"),
    ]
    if diagnosis.causes:
        value = ", ".join(percent(cause.confidence) for cause in diagnosis.causes)
        each = "" if len(diagnosis.causes) == 1 else ", in their order"
        found.insert(0, ("Confidence", value, f"probability that the cause is right{each}"))
    if diagnosis.causes and diagnosis.gain is not None:
        gain = diagnosis.gain
        found.append(
            (
                "Gain",
                f"{100.0 * gain.value:.0f} %",
                "of the error above the floor is gone; 95 % interval "
                f"{100.0 * gain.low:.0f} to {100.0 * gain.high:.0f} %",
            )
        )
    return found


def why(diagnosis: Diagnosis) -> list[str]:
    """Why each winner won, or why nobody did: a sentence for each cause of the hypothesis."""
    steps = by_step(diagnosis.fitted_candidates)
    if diagnosis.verdict is Verdict.NAMED:
        others = "" if len(steps) == 1 else ", beside the other causes of the verdict,"
        return [_winner(step, diagnosis.causes, others) for step in steps] + _unmodelled(diagnosis)
    return [_nobody(diagnosis, steps[0])] if steps else []


def _nobody(diagnosis: Diagnosis, step: list[FittedCandidate]) -> str:
    best = step[0]
    told = f"{_told(best)} does best, with {number(best.score)} nats"
    if diagnosis.verdict is Verdict.NOTHING_WRONG:
        return (
            f"Of {len(step)} suspects that were fitted fully, {told}. Logs of a machine without "
            "fault reach such scores by chance, so it is not a finding."
        )
    return (
        f"Of {len(step)} suspects that were fitted fully, {told}. It takes up part of the error, "
        "as a wrong cause may, and leaves too much of it to be a name."
    )


def _winner(step: list[FittedCandidate], causes: tuple[NamedCause, ...], beside: str) -> str:
    winner = next(
        (fitted_candidate for fitted_candidate in step if fitted_candidate.chosen), step[0]
    )
    alike = equivalents(step, causes)
    sentence = (
        f"{capital(_told(winner))}{beside} predicts data that its fit had not seen better than "
        f"your model does, by {number(winner.score)} nats"
    )
    others = [r for r in step if not r.chosen and r.candidate.cause.id not in alike]
    if others:
        margin = winner.score - others[0].score
        better = f"{number(margin)} nats better than" if margin > 0.0 else "no better than"
        sentence += f", and {better} the next rival, {_told(others[0])}"
        if margin <= 0.0:
            sentence += "; over all data together it is likelier all the same"
    if alike:
        names = joined([human(id_) for id_ in sorted(alike)], "or")
        sentence += f". These data cannot tell it from {names}"
    return sentence + "."


def _unmodelled(diagnosis: Diagnosis) -> list[str]:
    """A sentence where it may be something else altogether."""
    chance = diagnosis.unmodelled or 0.0
    if chance < DOUBT:
        return []
    return [
        "A learned residual, which stands for whatever has no name, explains about as much in "
        f"place of the causes: with {percent(chance)} probability it is none of those known."
    ]


def _told(fitted_candidate: FittedCandidate) -> str:
    return f"{fitted_candidate.candidate.cause.title} at {fitted_candidate.candidate.location}"
