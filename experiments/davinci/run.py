"""Transmission of a cable drive of a da Vinci grasper, from torques and angles at both ends.

No published work identifies the mechanism. A ladder of structures, each with one element more, is
fitted to 50 runs and tested on loads and frequencies that are held out. A claim that does not hold
there is not established. In addition, `reality_gap` diagnoses a model with a rigid cable and no
friction, with the causes of its catalogue.

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
from experiments.davinci.models import ABLATIONS, ALTERNATIVES, LADDER
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
TITLE = "Transmission of a cable drive of a da Vinci grasper"

CAUSES = (
    "tendon_elasticity",
    "coulomb_friction",
    "viscous_friction",
    "load_dependent_friction",
    "motor_side_friction",
    "backlash",
    "slack",
    "force_scale",
    "force_offset",
    "length_scale",
    "joint_offset",
    "joint_stiffness",
)
"""Causes that can occur in a cable drive on a test bench without moving masses and cameras."""

OPTIONS = Options(search=Settings(most=6, refits=5), unexplained=1.0, suggest=False)
"""Several causes act together, and the weakest contributes a hundredth of the evidence. The ladder
shows that a large remainder is to be expected, so it must not suppress the named causes."""


@dataclass(frozen=True)
class Args:
    """Transmission of a cable drive of a da Vinci grasper.

    Attributes:
        log: npz file with the runs, their channels and index_json.
        out: folder of the results.
        jobs: number of parallel processes.
        diagnosis: whether reality_gap also diagnoses the drive, which takes most of the time.
    """

    log: Path
    out: Path = Path("out/davinci")
    jobs: int = 1
    diagnosis: bool = True


def main(args: Args) -> Summary:
    """Fit all structures, evaluate them on data held out, diagnose; write summary and report.

    Raises:
        ExperimentError: the log cannot be used, or the folder holds other files.
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
    """Fit every structure to all runs, and to all except each load and each frequency."""
    structures = LADDER | ABLATIONS | ALTERNATIVES
    scores, fitted = {}, {}
    with progress_bar("structures", len(structures)) as progress:
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
            progress(name)
    return scores, fitted


def diagnosed(args: Args) -> Diagnosis:
    """Diagnose the model without friction and write the diagnosis to its own folder."""
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
    """Causes named by `reality_gap`: parameters of its model, and equivalents at the spindle."""
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
        f"RMS relative to the assumed error of models: {diagnosis.rms_before:.2f} before, "
        f"{diagnosis.rms_after:.2f} after. What remains depends on: {left or 'nothing found'}."
    )
    head = ("cause", "parameter", "value", "95 % interval", "unit", "at the spindle", "equivalent")
    return Table("What reality_gap named", head, rows, note)


def at_spindle(value: float, unit: str) -> str:
    """Force or compliance of the model's cable, as torque or angle at the nominal radius."""
    if unit == "N":
        return f"{value * RADIUS:.4g} N m"
    if unit == "m/N":
        return f"{value / RADIUS**2:.3g} rad/(N m)"
    return ""
