"""A verdict in words."""

from __future__ import annotations

from reality_gap.diagnosis import Diagnosis, NamedCause, Verdict

MANY = 8
"""Elements of a place with a note that are not listed."""


def sentence(diagnosis: Diagnosis) -> str:
    """What the verdict means and what to do about it."""
    if diagnosis.verdict is Verdict.NOTHING_WRONG:
        return (
            "Nothing is wrong with the model as far as these data can tell: what differs is noise "
            "and what every honest drawing is off by."
        )
    if diagnosis.verdict is Verdict.UNEXPLAINED:
        return (
            "Something is wrong that none of the known causes explains: "
            f"{diagnosis.unexplained_fraction:.0%} of the difference remains after the best of "
            f"them. {_hint(diagnosis)}"
        )
    return " ".join(_named(cause) for cause in diagnosis.causes) + _rest(diagnosis)


def _named(cause: NamedCause) -> str:
    foremost = cause.foremost()
    numbers = ", ".join(
        f"{name.replace('_', ' ')} {e.value:.4g} {e.unit} [{e.low:.4g}, {e.high:.4g}]"
        for name, e in ((name, cause.parameters[name]) for name in foremost)
    )
    more = len(cause.parameters) - len(foremost)
    if more:
        numbers += f" and {more} that are smaller"
    other = (
        f"; these data cannot tell it from {', '.join(cause.equivalent)}"
        if cause.equivalent
        else ""
    )
    title, place = cause.suspect.cause.title, cause.suspect.place
    where = place.note if len(place.elements) > MANY and place.note else str(place)
    return (
        f"{title[0].upper()}{title[1:]} at {where}: {numbers} "
        f"(confidence {cause.confidence:.0%}{other})."
    )


def _rest(diagnosis: Diagnosis) -> str:
    if diagnosis.gain is None:
        return ""
    return (
        f" With it in the model, {diagnosis.gain.value:.0%} of the avoidable error is gone on "
        "readings that were not used to find it."
    )


def _hint(diagnosis: Diagnosis) -> str:
    if not diagnosis.depends_on:
        return "It follows none of the quantities that were looked at."
    first = diagnosis.depends_on[0]
    return f"It shows most in {first.channel} and goes with the {first.quantity}."
