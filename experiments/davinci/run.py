"""What the cable drive of a da Vinci grasper does, from torques and angles at both of its ends.

No published work names the mechanism. A ladder of structures, each with one thing more, is fitted
to 50 runs and judged on loads and on frequencies that it was not fitted to; what does not hold
there is not established. Beside it, `reality_gap` diagnoses a model with a stiff cable and no
friction, with the causes that it knows.

Data (not in this package; `--log` names the user's file): J. J. O'Neill, T. K. Stephens and T. M.
Kowalewski, IEEE RA-L 3(4):3027-3034, 2018, under ODbL / DbCL (attribution, share-alike).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from experiments.davinci.fit import Fitted, errors, fit, held_out, intervals
from experiments.davinci.log import RATE, Runs, read_runs
from experiments.davinci.models import ABLATIONS, LADDER, RIVALS
from experiments.davinci.study import RADIUS, make_study
from experiments.davinci.tables import (
    FINE_RATE,
    WHOLE_NAME,
    Scores,
    evidence_table,
    ladder_table,
    open_table,
    parameter_table,
)
from experiments.harness.common import Summary, check_jobs, make_summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import LEAST_WIDTH
from experiments.harness.report import Table, print_table, write_report
from experiments.harness.runner import progress_bar
from mjcf_sandbox.files import write_json
from reality_gap import CATALOGUE, Diagnosis, Options, RealityGapError, diagnose
from reality_gap.inference.forward_selection import Settings
from reality_gap.report.files import check_out, write_diagnosis

NAME = "davinci"
TITLE = "The cable drive of a da Vinci grasper: what its transmission does"

CAUSES = (
    "tendon_elasticity",
    "coulomb_friction",
    "viscous_friction",
    "load_dependent_friction",
    "backlash",
    "slack",
    "force_scale",
    "force_offset",
    "length_scale",
    "joint_offset",
    "joint_stiffness",
)
"""What a cable drive on a bench may have; masses and cameras it has not."""

OPTIONS = Options(search=Settings(most=6, refits=5), unexplained=1.0, suggest=False)
"""Several causes are there at once, the weakest a hundredth of the evidence; and what remains,
which the ladder shows, is no reason to name none."""


@dataclass(frozen=True)
class Args:
    """What the cable drive of a da Vinci grasper does.

    Attributes:
        log: npz file with the runs, their channels and index_json.
        out: folder of the results.
        jobs: processes that work at the same time.
        diagnosis: whether reality_gap diagnoses the drive, too, which takes most of the time.
    """

    log: Path
    out: Path = Path("out/davinci")
    jobs: int = 1
    diagnosis: bool = True


def main(args: Args) -> Summary:
    """Fit all structures, hold out loads and frequencies, diagnose; write summary and report.

    Raises:
        ExperimentError: the log cannot be used, or the folder is somebody's.
    """
    from experiments.davinci.figures import pictures

    begin = time.perf_counter()
    check_jobs(args.jobs)
    runs = read_runs(args.log)
    scores, fitted = compare(runs)
    best = fitted[WHOLE_NAME]
    widths = {name: intervals(found, runs) for name, found in fitted.items()}
    finer = fit(best.structure, read_runs(args.log, FINE_RATE), best.values)
    tables = [
        evidence_table(scores),
        open_table(scores, fitted, widths, finer),
        ladder_table(scores),
        parameter_table(best, widths[WHOLE_NAME]),
    ]
    if args.diagnosis:
        tables.append(cause_table(diagnosed(args)))
    console = Console()
    wide = Console(width=max(console.width, LEAST_WIDTH))
    for table in tables:
        print_table(wide, table)
    summary = make_summary(
        NAME,
        {},
        time.perf_counter() - begin,
        title=TITLE,
        tables=[table.plain() for table in tables],
    )
    write_json(args.out / "summary.json", summary)
    page = summary | {"seeds": ["none, for these are measurements"]}
    shown = pictures(runs, best, scores)
    write_report(args.out / "report.html", TITLE, str(__doc__), page, tables, shown)
    return summary


def compare(runs: Runs) -> tuple[dict[str, Scores], dict[str, Fitted]]:
    """Fit every structure to all runs, and to all but each load and each frequency."""
    structures = LADDER | ABLATIONS | RIVALS
    scores, fitted = {}, {}
    with progress_bar("structures", len(structures)) as tell:
        for name, structure in structures.items():
            found = fit(structure, runs)
            fitted[name] = found
            scores[name] = Scores(
                structure,
                errors(found, runs),
                held_out(structure, runs, runs.load, found.values),
                held_out(structure, runs, runs.frequency, found.values),
                name not in LADDER,
            )
            tell(name)
    return scores, fitted


def diagnosed(args: Args) -> Diagnosis:
    """The diagnosis of the model without friction, written to its own folder."""
    folder = args.out / "diagnosis"
    causes: Sequence = [CATALOGUE[name] for name in CAUSES]
    try:
        check_out(folder)
        study = make_study(read_runs(args.log, RATE))
        diagnosis = diagnose(study, args.jobs, causes=causes, options=OPTIONS)
        write_diagnosis(diagnosis, study, folder)
    except RealityGapError as error:
        raise ExperimentError(str(error)) from error
    return diagnosis


def cause_table(diagnosis: Diagnosis) -> Table:
    """What `reality_gap` named, as its model has it and as torques and angles at the spindle."""
    rows = []
    for cause in diagnosis.causes:
        for name, e in cause.parameters.items():
            rows.append(
                (
                    str(cause.candidate),
                    name,
                    f"{e.value:.4g}",
                    f"{e.low:.4g} to {e.high:.4g}",
                    e.unit,
                    at_spindle(e.value, e.unit),
                    ", ".join(cause.equivalent),
                )
            )
    left = "; ".join(f"{d.quantity} {100 * d.fraction:.0f} %" for d in diagnosis.depends_on)
    note = (
        f"RMS over what models are taken to leave: {diagnosis.rms_before:.2f} before, "
        f"{diagnosis.rms_after:.2f} after. What remains depends on: {left or 'nothing found'}."
    )
    head = ("cause", "parameter", "value", "95 % interval", "unit", "at the spindle", "equivalent")
    return Table("What reality_gap named", head, rows, note)


def at_spindle(value: float, unit: str) -> str:
    """A force or compliance of the model's cable, whose radius is nominal, as torque or angle."""
    if unit == "N":
        return f"{value * RADIUS:.4g} N m"
    if unit == "m/N":
        return f"{value / RADIUS**2:.3g} rad/(N m)"
    return ""
