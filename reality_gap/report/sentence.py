"""Sentence: the outcome of a diagnosis in words, with advice."""

from __future__ import annotations

from reality_gap.diagnosis import NamedCause, Verdict, names_stop
from reality_gap.inference.outcome import Outcome
from reality_gap.report.formatting import capital, human, probability, rounded

VISIBLE = 5.0
"""Residual, over that of the noise, from which on a report says what tolerances excuse."""
GAIN = "position_gain"
OF_MOTOR = (GAIN, "velocity_gain", "force_scale", "armature")
"""Causes that scale with the forces of a machine, beside those whose parameters are forces."""
MANY = 8
"""Number of elements above which a location is described by its note."""


def sentence(outcome: Outcome) -> str:
    """Return what the verdict means and what to do about it."""
    if outcome.verdict is Verdict.NOTHING_WRONG:
        return (
            "Nothing is wrong with the model as far as these data can show: the differences are "
            f"within the noise and the tolerances of a nominal model.{_tolerated(outcome)}"
        )
    if outcome.verdict is Verdict.UNEXPLAINED:
        left = probability(outcome.unexplained_fraction)
        attempt = f"{left} of the difference remains after the best of them"
        if outcome.objection is not None:
            attempt = (
                f"the best attempt, which leaves {left} of the difference, {outcome.objection}"
            )
        return (
            f"Something is wrong that none of the known causes explains: {attempt}. "
            f"{_dependence(outcome)}"
        )
    causes = " ".join(_cause(cause) for cause in outcome.causes) + _proportion(outcome)
    if outcome.verdict is Verdict.NAMED:
        return causes + _gain(outcome)
    one = len(outcome.causes) == 1
    return (
        f"{'This cause explains' if one else 'These causes explain'} a part of the error, also on "
        f"held-out data; the rest has no known cause: {causes}{_gain(outcome)} {_rest(outcome)}"
    )


def _tolerated(outcome: Outcome) -> str:
    """Return how large the differences are that tolerances excuse; empty if they are small.

    Rounding makes no noise at rest, so that the floor is below one noise.
    """
    before, most = outcome.score.before, outcome.measures.get("deviation")
    if most is None or before < max(1.0, VISIBLE * outcome.score.floor):
        return ""
    return (
        f" They are {before:.3g} noises; deviations of at most {most:.2g} tolerances explain that. "
        "Smaller tolerances (--tolerance below 1) show whether your model is better than that."
    )


def _cause(cause: NamedCause) -> str:
    foremost = cause.foremost()
    numbers = ", ".join(
        f"{human(name)} {e.value:.4g} {'' if e.unit == '1' else f'{e.unit} '}"
        f"[{e.low:.4g}, {e.high:.4g}]"
        for name, e in ((name, rounded(cause, name)) for name in foremost)
    )
    more = len(cause.foremost(len(cause.parameters))) - len(foremost)
    if more:
        numbers += f" and {more} that are smaller"
    other = (
        f"; these data cannot distinguish it from {', '.join(cause.equivalent)}"
        if cause.equivalent
        else ""
    )
    title, location = cause.candidate.cause.title, cause.candidate.location
    where = location.note if len(location.elements) > MANY and location.note else str(location)
    confidence = f"confidence {probability(cause.confidence)}"
    return f"{capital(title)} at {where}: {numbers} ({confidence}{other})."


def _proportion(outcome: Outcome) -> str:
    """Return that forces are known relative to masses, where no force is measured.

    A position servo moves the same with all masses and forces twice as large. Where only one of
    these is named, all others are those of the model.
    """
    forces = [cause for cause in outcome.causes if _is_force(cause)]
    gains = [cause for cause in forces if cause.candidate.cause.id == GAIN]
    if len(forces) < 2 or not gains or outcome.measures.get("forces_measured", 1.0):
        return ""
    return (
        " No force is measured: these gains and forces are known in proportion to the masses of "
        "the model, and wrong by the same factor as those."
    )


def _is_force(cause: NamedCause) -> bool:
    """Return whether a cause is a gain, a force, or a rotor."""
    force = any(estimate.unit.startswith("N") for estimate in cause.parameters.values())
    return force or cause.candidate.cause.id in OF_MOTOR


def _gain(outcome: Outcome) -> str:
    if outcome.gain is None:
        likelihood = outcome.likelihood_gain
        if likelihood is None or likelihood.low <= 0.0:
            return ""
        return (
            f" With {_them(outcome)} in the model, the log likelihood of held-out readings "
            f"is higher by {likelihood.value:.0f} nats "
            f"[{likelihood.low:.0f}, {likelihood.high:.0f}]."
        )
    return (
        f" With {_them(outcome)} in the model, {probability(outcome.gain.value)} of the avoidable "
        "error is gone on held-out readings."
    )


def _them(outcome: Outcome) -> str:
    return "it" if len(outcome.causes) == 1 else "them"


def _rest(outcome: Outcome) -> str:
    """Return what the rest of the error depends on."""
    if not outcome.depends_on:
        return "The rest depends on none of the simulated quantities."
    first = outcome.depends_on[0]
    if names_stop(outcome.criteria):  # what else it depends on is a consequence
        return f"The rest shows most in {first.channel}."
    return f"The rest depends most on the {first.quantity} and shows most in {first.channel}."


def _dependence(outcome: Outcome) -> str:
    if not outcome.depends_on:
        return "It depends on none of the simulated quantities."
    first = outcome.depends_on[0]
    if names_stop(outcome.criteria):
        return f"It shows most in {first.channel}."
    return f"It shows most in {first.channel} and depends on the {first.quantity}."
