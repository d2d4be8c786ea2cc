"""report.html: a diagnosis as one page that needs no network and no knowledge of this package."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import matplotlib
import mujoco
import numpy as np
import scipy
from matplotlib.figure import Figure

from reality_gap.diagnosis import (
    Calibration,
    Diagnosis,
    NamedCause,
    Rejected,
    Verdict,
    names_stop,
)
from reality_gap.report import words
from reality_gap.report.formatting import (
    ROUNDING,
    capital,
    human,
    joined,
    number,
    percent,
    probability,
    rounded,
    shown,
    with_interval,
)
from reality_gap.report.log_text import agreement, flat_rows, log_rows
from reality_gap.report.plots.candidates import candidate_evidence
from reality_gap.report.plots.canvas import SPLITS, png
from reality_gap.report.plots.commands import commands, left_out
from reality_gap.report.plots.comparison import against, constant_share
from reality_gap.report.plots.gain import channel_gain
from reality_gap.report.plots.logs import log_intervals
from reality_gap.report.plots.parameters import intervals
from reality_gap.report.plots.remainder import remainder
from reality_gap.report.plots.signals import (
    MOST_ROWS,
    Signal,
    residual_map,
    signals,
    starts,
    time_traces,
)
from reality_gap.report.plots.waterfall import waterfall
from reality_gap.simulation.replayer import USUAL
from reality_gap.study.data import Study

MOST_DIFF = 600
"""Largest number of lines of the XML difference that are shown."""
MOST_CORRECTIONS = 12
"""Largest number of corrections of a calibrated model that are shown."""


def write_report(diagnosis: Diagnosis, study: Study, path: Path) -> None:
    """Write the page of a diagnosis.

    Args:
        diagnosis: the results.
        study: the study that was diagnosed.
        path: file to write.
    """
    path.write_text(page(diagnosis, study), encoding="utf-8")


def page(diagnosis: Diagnosis, study: Study) -> str:
    """Return the page of a diagnosis as HTML."""
    source = (files("reality_gap.report") / "report.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {
        "percent": percent,
        "probability": probability,
        "number": number,
        "capital": capital,
    }
    found = signals(diagnosis.traces)
    return environment.from_string(source).render(
        diagnosis=diagnosis,
        verdict=diagnosis.verdict.value,
        kind=words.kind(diagnosis.verdict),
        notes=diagnosis.notes or (),
        about_notes=words.about_notes(diagnosis),
        about_restarts=words.about_restarts(diagnosis),
        figures=words.figures(diagnosis),
        why=words.why(diagnosis),
        rows=[row for cause in diagnosis.causes for row in parameter_rows(cause)],
        sections=_sections(diagnosis),
        stopped=names_stop(diagnosis.criteria),
        attempt=attempt_rows(diagnosis.rejected),
        pictures=_pictures(diagnosis, study, found),
        rows_left=max(0, len(found) - MOST_ROWS),
        worst=found[0].name if found else "",
        constant=constant_share(found[0]) if found else 0.0,
        parts=_parts(found),
        difference=xml_difference(study, diagnosis.extended_xml),
        corrections=correction_rows(diagnosis.calibration),
        usual=f"/{USUAL}/" in diagnosis.extended_xml,
        effects=[candidate for candidate, _ in diagnosis.effects],
        left_out=0 if diagnosis.next_experiment is None else left_out(diagnosis.next_experiment),
        not_judged=not_judged(diagnosis),
        hidden=flat_rows(diagnosis.flat, True),
        together=flat_rows(diagnosis.flat, False),
        only=[c.title for c in diagnosis.causes if c.candidate.location.log],
        model=study.model.name,
        inverse=study.inverse,
        fingerprint=hashlib.sha256(study.model.read_bytes()).hexdigest()[:16],
        versions=f"mujoco {mujoco.__version__}, numpy {np.__version__}, scipy {scipy.__version__}",
    )


def parameter_rows(cause: NamedCause) -> list[tuple[str, ...]]:
    """Return rows of cause, location, parameter, value, interval, confidence and equivalents."""
    rows: list[tuple[str, ...]] = []
    for name in cause.foremost():
        estimate = rounded(cause, name)
        factor, unit = shown(estimate.unit, estimate.value)
        value, low, high = with_interval(estimate, factor)
        rows.append(
            (
                capital(cause.candidate.cause.title),
                str(cause.candidate.location),
                human(name),
                f"{value} {unit}".strip(),
                f"{low} to {high} {unit}".strip(),
                probability(cause.confidence),
                ", ".join(human(id_) for id_ in cause.equivalent) or "none",
            )
        )
    return rows


def attempt_rows(rejected: Sequence[Rejected]) -> list[tuple[str, ...]]:
    """Return rows of cause, location, values and the reason why the cause is not named."""
    rows: list[tuple[str, ...]] = []
    for one in rejected:
        values = []
        for p in one.candidate.parameters:
            value = one.values[p.name]
            value = 0.0 if abs(value) < ROUNDING * abs(p.scale) else value
            factor, unit = shown(p.unit, value)
            values.append(f"{human(p.name)} {number(factor * value)} {unit}".strip())
        title = capital(one.candidate.cause.title)
        rows.append((title, str(one.candidate.location), ", ".join(values), f"it {one.reason}"))
    return rows


def correction_rows(calibration: Calibration | None) -> list[tuple[str, ...]]:
    """Return rows of number, location, adjustment and its size in tolerances; the largest ones."""
    rows: list[tuple[str, ...]] = []
    for one in calibration.corrections[:MOST_CORRECTIONS] if calibration else ():
        factor, unit = shown(one.parameter.unit, one.value)
        property_of = one.candidate.cause.title.removeprefix("wrong ")
        title = f"{property_of}, {human(one.parameter.name)}"
        adjustment = f"{number(factor * one.value)} {unit}".strip()
        tolerances = number(abs(one.tolerances), 2)
        rows.append((capital(title), str(one.candidate.location), adjustment, tolerances))
    return rows


class Section(NamedTuple):
    """What the page says about one named cause.

    Attributes:
        title: the cause and its location.
        why: sentences.
        rows: see `parameter_rows`.
        number: by which its pictures are named.
        agreement: whether it is the same in all logs; empty if there is one log.
        logs: see `log_rows`.
    """

    title: str
    why: list[str]
    rows: list[tuple[str, ...]]
    number: int
    agreement: str
    logs: list[tuple[str, str, str, str]]


def _sections(diagnosis: Diagnosis) -> list[Section]:
    return [
        Section(
            title=capital(c.title),
            why=words.why_named(diagnosis, c),
            rows=parameter_rows(c),
            number=i,
            agreement="" if c.logs is None else agreement(c.logs),
            logs=log_rows(c),
        )
        for i, c in enumerate(diagnosis.causes)
    ]


def xml_difference(study: Study, extended: str) -> list[tuple[str, str]]:
    """Return the lines by which both models differ in XML, each with the name of its style."""
    original = study.spec().to_xml()
    lines = list(difflib.unified_diff(original.splitlines(), extended.splitlines(), n=2))[2:]
    styles = {"+": "added", "-": "removed", "@": "context"}
    shown_lines = [(styles.get(line[:1], ""), line) for line in lines[:MOST_DIFF]]
    if len(lines) > MOST_DIFF:
        shown_lines.append(("context", f"... and {len(lines) - MOST_DIFF} more lines"))
    return shown_lines


def not_judged(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return rows of causes that were not judged and the reason, one for each reason.

    Causes that would show in another motion are listed elsewhere, with this motion.
    """
    hidden = {c.cause.id for one in diagnosis.flat if one.separable for c in one.candidates}
    reasons: dict[str, list[str]] = {}
    for cause, reason in diagnosis.not_judged:
        if cause not in hidden:
            reasons.setdefault(reason, []).append(human(cause))
    return [(", ".join(causes), reason) for reason, causes in reasons.items()]


def _parts(found: list[Signal]) -> str:
    """Return the shares of the data that were used to fit, to choose and to report."""
    if not found:
        return "none"
    split = np.concatenate([signal.split for signal in found])
    shares = [
        f"{percent(float(np.mean(split == i)))} to {name}" for i, (name, _) in enumerate(SPLITS)
    ]
    return joined(shares)


def _pictures(diagnosis: Diagnosis, study: Study, found: list[Signal]) -> dict[str, str]:
    """Return the pictures for which there are data, as PNG in base64."""
    made: dict[str, Callable[[], Figure]] = {}
    if found:
        made["map"] = lambda: residual_map(found)
        made["traces"] = lambda: time_traces(found, starts(diagnosis.traces))
        made["against"] = lambda: against(found[0], found)
        total = (diagnosis.rms_before, diagnosis.rms_after)
        made["gain"] = lambda: channel_gain(found, total, diagnosis.noise_floor)
    if diagnosis.waterfall:
        steps, others = diagnosis.waterfall, len(diagnosis.waterfall) - len(diagnosis.causes)
        made["waterfall"] = lambda: waterfall(steps, diagnosis.noise_floor, others)
    if diagnosis.fitted_candidates and not diagnosis.causes:
        made["candidates"] = lambda: candidate_evidence(diagnosis.fitted_candidates, ())
    for i, cause in enumerate(diagnosis.causes):
        made |= _cause_pictures(diagnosis, cause, i)
    if diagnosis.verdict is not Verdict.NOTHING_WRONG:
        made["remainder"] = lambda: remainder(
            "named causes" if diagnosis.causes else "known causes (too little)",
            1.0 - diagnosis.unexplained_fraction,
            diagnosis.explainable_fraction,
            diagnosis.depends_on,
        )
    experiment = diagnosis.next_experiment
    if experiment is not None:
        model: Any = study.spec().compile()
        made["experiment"] = lambda: commands(experiment, model)
    with matplotlib.rc_context({"text.parse_math": False}):  # names may contain dollars
        return {name: png(draw()) for name, draw in made.items()}


def _cause_pictures(
    diagnosis: Diagnosis, cause: NamedCause, i: int
) -> dict[str, Callable[[], Figure]]:
    """Return the pictures of one named cause."""
    step = tuple(words.step_of(diagnosis, cause))
    made: dict[str, Callable[[], Figure]] = {f"parameters_{i}": lambda: intervals((cause,))}
    if cause.logs is not None and any(value.parameters for value in cause.logs.values):
        made[f"logs_{i}"] = lambda: log_intervals(cause)
    if step:
        made[f"candidates_{i}"] = lambda: candidate_evidence(step, (cause,))
    return made
