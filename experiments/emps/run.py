"""EMPS: diagnosis of a real drive from its force.

The Electro-Mechanical Positioning System is a motor that drives a carriage through a ball screw in
closed loop. The controller hides errors of the model in the position; the force shows them. The
nominal model is a mass alone. It is diagnosed twice: with textbook causes, and with the whole
catalogue. There, direction-dependent friction can replace viscous friction, Coulomb friction and
offset, and explain more than these together.

Data (not in this package; `--log` names the user's file): A. Janot, M. Gautier and M. Brunot, "Data
Set and Reference Models of EMPS", Workshop on Nonlinear System Identification Benchmarks, 2019;
free to use with citation.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.emps.log import (
    MASS,
    PUBLISHED,
    PUBLISHED_ERROR,
    PUBLISHED_ERROR_BY_DIRECTION,
    make_study,
    measured_force,
    read_log,
    relative_error,
    repeatability,
)
from experiments.emps.regression import UNITS, Regression, force_of, regress
from experiments.harness.common import Summary, check_jobs, make_summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import LEAST_WIDTH
from experiments.harness.report import Table, print_table, write_report
from mjcf_sandbox.files import write_json
from reality_gap import CATALOGUE, Diagnosis, Options, RealityGapError, diagnose
from reality_gap.causes.base import Cause
from reality_gap.diagnosis import FittedCandidate
from reality_gap.inference.forward_selection import Settings
from reality_gap.report.files import check_out, write_diagnosis
from reality_gap.study.data import Study

NAME = "emps"
TITLE = "EMPS: force of a real drive that a mass alone does not explain"
DIRECTION, SPRING = "direction_dependent_friction", "joint_stiffness"

TEXTBOOK = [cause for name, cause in CATALOGUE.items() if name != DIRECTION]

OPTIONS = Options(search=Settings(most=4), unexplained=1.0, suggest=False)
"""The offset is a twentieth of the force, so a cause may add little evidence. The remainder of
a few per cent must not suppress the named causes."""

BASE = ("mass", "viscous", "coulomb", "offset")
FITS: dict[str, Sequence[str]] = {
    "as published": BASE,
    "with a spring": (*BASE, "spring"),
    "viscous friction by direction": (*BASE, "viscous by direction"),
    "by direction, with a spring": (*BASE, "viscous by direction", "spring"),
}


@dataclass(frozen=True)
class Args:
    """Diagnosis of the Electro-Mechanical Positioning System from its force.

    Attributes:
        log: CSV file with the columns t_s, q_ref_m, q_m, u_V.
        out: folder of the results.
        jobs: number of parallel processes.
    """

    log: Path
    out: Path = Path("out/emps")
    jobs: int = 1


def main(args: Args) -> Summary:
    """Diagnose the log twice; write summary.json, report.html and both diagnoses.

    Raises:
        ExperimentError: the log cannot be used, or the folder holds other files.
    """
    from experiments.emps.figures import pictures

    begin = time.perf_counter()
    check_jobs(args.jobs)
    log = read_log(args.log)
    study = make_study(log)
    first = diagnosed(study, args, "textbook", TEXTBOOK)
    second = diagnosed(study, args, "all", list(CATALOGUE.values()))
    fits = {title: regress(study, names) for title, names in FITS.items()}
    errors = force_errors(study, first, second, fits)
    tables = [
        parameter_table(first, second, fits["as published"]),
        error_table(errors),
        remainder_table(first, second),
        candidate_table(first, second),
        regression_table(fits),
    ]
    wide = Console(width=max(Console().width, LEAST_WIDTH))
    for table in tables:
        print_table(wide, table)
    summary = make_summary(
        NAME,
        {},
        time.perf_counter() - begin,
        title=TITLE,
        errors=errors,
        named=[*named(first), *named(second)],
        depends_on=[
            {"quantity": d.quantity, "share": round(d.fraction, 3)} for d in first.depends_on
        ],
        repeatability_N=repeatability(log, study),
        tables=[table.plain() for table in tables],
    )
    write_json(args.out / "summary.json", summary)
    shown = pictures(log, study, first, second, fits)
    page = summary | {"seeds": ["none, for these are measurements"]}
    write_report(args.out / "report.html", TITLE, str(__doc__), page, tables, shown)
    return summary


def diagnosed(study: Study, args: Args, name: str, causes: Sequence[Cause]) -> Diagnosis:
    """Diagnose the study with some causes and write the diagnosis to the folder ``name``."""
    folder = args.out / name
    try:
        check_out(folder)
        diagnosis = diagnose(study, args.jobs, causes=causes, options=OPTIONS)
        write_diagnosis(diagnosis, study, folder)
    except RealityGapError as error:
        raise ExperimentError(str(error)) from error
    Console().print(f"{name} causes: {diagnosis.sentence}")
    return diagnosis


def named(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Named causes, for JSON."""
    return [
        {
            "cause": cause.candidate.cause.id,
            "confidence": round(cause.confidence, 4),
            "equivalent": list(cause.equivalent),
            "parameters": {
                name: {"value": e.value, "low": e.low, "high": e.high, "unit": e.unit}
                for name, e in cause.parameters.items()
            },
        }
        for cause in diagnosis.causes
    ]


def force_errors(
    study: Study, first: Diagnosis, second: Diagnosis, fits: dict[str, Regression]
) -> dict[str, float]:
    """Relative errors of the force over the whole log [%]."""
    force = measured_force(study)
    found = {
        "mass alone": relative_error(force, first.traces[0].before),
        "published parameters": relative_error(force, force_of(study, {"mass": MASS} | PUBLISHED)),
        "textbook causes": relative_error(force, first.traces[0].after),
        "all causes": relative_error(force, second.traces[0].after),
    }
    found |= {f"least squares, {title}": fit.error for title, fit in fits.items()}
    return {name: round(error, 3) for name, error in found.items()}


def parameter_table(first: Diagnosis, second: Diagnosis, fit: Regression) -> Table:
    """Table of the named parameters and the published ones."""
    published = {
        ("viscous_friction", "damping"): PUBLISHED["viscous"],
        ("coulomb_friction", "friction"): PUBLISHED["coulomb"],
        ("force_offset", "force"): -PUBLISHED["offset"],
    }
    rows = []
    for stage, diagnosis in (("textbook", first), ("all", second)):
        for cause in diagnosis.causes:
            for name, e in cause.parameters.items():
                known = (
                    published.get((cause.candidate.cause.id, name)) if stage == "textbook" else None
                )
                inside = "" if known is None else "yes" if e.low <= known <= e.high else "NO"
                rows.append(
                    (
                        f"{cause.candidate.cause.id}: {name}",
                        stage,
                        f"{e.value:.4g}",
                        f"{e.low:.4g} to {e.high:.4g}",
                        e.unit,
                        "" if known is None else f"{known:.4f}",
                        inside,
                        ", ".join(cause.equivalent),
                    )
                )
    low, high = (fit.values["mass"] + side * fit.widths["mass"] for side in (-1, 1))
    note = (
        f"Mass: {MASS} kg as published and in the model; {low:.2f} to {high:.2f} kg by least "
        "squares. An offset that acts forward reduces the force of the drive, so its sign is "
        "opposite to that of the published offset."
    )
    head = (
        "cause",
        "causes",
        "value",
        "95 % interval",
        "unit",
        "published",
        "inside",
        "equivalent",
    )
    return Table("Named causes", head, rows, note)


def error_table(errors: dict[str, float]) -> Table:
    """Table of the relative errors of the force."""
    rows = [(name, f"{error:.2f}") for name, error in errors.items()]
    note = (
        f"Published for these data: {PUBLISHED_ERROR} %, and {PUBLISHED_ERROR_BY_DIRECTION} % with "
        "direction-dependent friction. Their filters are not published, so the published "
        "parameters are also evaluated with ours."
    )
    return Table("Relative error of the force [%]", ("model", "error"), rows, note)


def remainder_table(first: Diagnosis, second: Diagnosis) -> Table:
    """Table of quantities that explain the remainder of the force."""
    rows = [
        (d.quantity, stage, f"{100 * d.fraction:.0f} %")
        for stage, diagnosis in (("textbook", first), ("all", second))
        for d in diagnosis.depends_on
    ]
    note = "Share of the power of the remainder that the quantity explains on data held out."
    return Table("Dependence of the remainder", ("quantity", "causes", "share"), rows, note)


def candidate_table(first: Diagnosis, second: Diagnosis) -> Table:
    """Table of all fitted candidates."""
    rows = [
        (str(r.candidate), stage, r.step + 1, f"{r.score:.1f}", f"{r.confidence:.3f}", _chosen(r))
        for stage, diagnosis in (("textbook", first), ("all", second))
        for r in diagnosis.fitted_candidates
    ]
    note = f"Score: evidence on data held out [nats]. A spring is {SPRING}."
    return Table(
        "Candidates", ("candidate", "causes", "step", "score", "confidence", "chosen"), rows, note
    )


def _chosen(fitted_candidate: FittedCandidate) -> str:
    return "yes" if fitted_candidate.chosen else ""


def regression_table(fits: dict[str, Regression]) -> Table:
    """Table of the parameters by least squares."""
    rows = [
        (
            f"{name} [{UNITS[name]}]",
            *(
                f"{fit.values[name]:.4g} ± {fit.widths[name]:.2g}" if name in fit.values else ""
                for fit in fits.values()
            ),
        )
        for name in UNITS
    ]
    note = (
        "Half widths of 95 % intervals, from the scatter of blocks of a second. Viscous by "
        "direction: half the difference of forward and backward. With it no offset remains: these "
        "data do not separate an offset from direction-dependent friction."
    )
    return Table("Least squares on the inverse dynamic model", ("term", *fits), rows, note)
