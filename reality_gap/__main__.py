"""What a simulation gets wrong, from measured data: diagnose, check, init, unpack."""

from __future__ import annotations

import math
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from reality_gap.errors import RealityGapError, StudyError, one_line

if TYPE_CHECKING:
    from rich.console import Console

    from reality_gap.diagnosis import Diagnosis


@dataclass(frozen=True)
class Diagnose:
    """Find out what a study's model gets wrong; writes verdict.json, extended.xml, report.html."""

    study: tyro.conf.Positional[Path]
    """STUDY.yaml: model, logs, and which column is what."""
    out: Path
    """Folder to write to; made whole or not at all."""
    jobs: int = os.cpu_count() or 1
    """Number of processes."""
    tolerance: float = 1.0
    """How much more than usual an honest drawing of this machine may be off: 3 for a rough one."""


@dataclass(frozen=True)
class Check:
    """Say in sentences what is wrong with a study, before anything is computed."""

    study: tyro.conf.Positional[Path]
    """STUDY.yaml: model, logs, and which column is what."""


@dataclass(frozen=True)
class Init:
    """Write a study to edit, with columns guessed by their names."""

    model: tyro.conf.Positional[Path]
    """MJCF file of the machine."""
    logs: tyro.conf.Positional[tuple[Path, ...]]
    """CSV or Parquet files, one or more."""
    out: Path = Path("STUDY.yaml")
    """Where to write; the model and the logs must lie in its folder or below."""


@dataclass(frozen=True)
class Unpack:
    """Write the topics of a ROS bag or an MCAP file as CSV files, for init."""

    bag: tyro.conf.Positional[Path]
    """A .bag file, the folder of a ROS 2 bag, or an .mcap file."""
    out: Path
    """Folder to make."""
    topics: tuple[str, ...] = ()
    """Which topics; by default all that hold numbers."""
    arrival: bool = False
    """Take the time at which messages were recorded, not that of their stamps."""


Command = (
    Annotated[Diagnose, tyro.conf.subcommand("diagnose")]
    | Annotated[Check, tyro.conf.subcommand("check")]
    | Annotated[Init, tyro.conf.subcommand("init")]
    | Annotated[Unpack, tyro.conf.subcommand("unpack")]
)


def diagnose(command: Diagnose, console: Console) -> None:
    """Diagnose a study, write what was found, and print the verdict."""
    from rich.progress import Progress

    from reality_gap.check import check_study
    from reality_gap.inference.checkpoint import forget
    from reality_gap.inference.verdict import Options
    from reality_gap.io.loader import load_study
    from reality_gap.pipeline import diagnose as find
    from reality_gap.report.files import check_out, write_diagnosis
    from reality_gap.simulation.episode import silence

    if command.jobs < 1:
        raise StudyError(f"--jobs is a number of processes, 1 or more, not {command.jobs}")
    if not 0.0 < command.tolerance < math.inf:
        raise StudyError(f"--tolerance is a factor above 0, 1 as usual, not {command.tolerance}")
    check_out(command.out)
    silence()
    study = load_study(command.study)
    for sentence in check_study(study):
        _say(console, f"note: {sentence}")
    work = command.out.absolute().with_name(f".{command.out.name}.work")
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("reading", total=1.0)
        diagnosis = find(
            study,
            jobs=command.jobs,
            options=Options(tolerance=command.tolerance),
            progress=lambda share, what: bar.update(task, completed=share, description=what),
            work=work,
        )
    write_diagnosis(diagnosis, study, command.out)
    forget(work)
    _show(diagnosis, console)
    _say(console, f"See {command.out / 'report.html'}")


def check(command: Check, console: Console) -> None:
    """Print what is wrong with a study, or that nothing is."""
    from reality_gap.check import check_study, summary, unjudged
    from reality_gap.io.loader import load_study
    from reality_gap.simulation.episode import silence

    silence()
    study = load_study(command.study)
    sentences = check_study(study)
    lines = list(sentences)
    if not sentences:
        lines.append(f"nothing wrong with this study: {summary(study)}")
    missing = unjudged(study)
    if missing:
        lines.append(
            "cannot be judged, as neither model nor log has what they act on: " + ", ".join(missing)
        )
    for line in lines:
        _say(console, line)


def init(command: Init, console: Console) -> None:
    """Write a draft of a study, never over a file that exists."""
    from mjcf_sandbox.files import write_text
    from reality_gap.io.template import draft_study

    out = command.out
    if out.exists():
        raise StudyError(f"{out} exists and is left alone; give another --out")
    if not out.parent.is_dir():
        raise StudyError(f"there is no folder {out.parent} to write {out.name} to")
    text = draft_study(command.model, command.logs, out.parent)
    write_text(out, text)
    _say(console, f"wrote {out}; edit it, then: python -m reality_gap check {out}")


def unpack(command: Unpack, console: Console) -> None:
    """Write a bag's topics as CSV files."""
    from rich.progress import Progress

    from reality_gap.io.rosbag_sandbox import unpack_in_sandbox

    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("reading", total=1.0)
        paths = unpack_in_sandbox(
            command.bag,
            command.out,
            command.topics,
            command.arrival,
            lambda share: bar.update(task, completed=share),
        )
    for path in paths:
        _say(console, f"wrote {command.out / path.name}")
    _say(console, f"now: python -m reality_gap init MODEL {command.out}/*.csv")


def _say(console: Console, line: str) -> None:
    """Print a line as it is; names in it may be anybody's."""
    console.print(one_line(line), markup=False, highlight=False)


def _show(diagnosis: Diagnosis, console: Console) -> None:
    """The verdict, and its causes as a table."""
    from rich.table import Table

    from reality_gap.report.formatting import number, percent, shown

    _say(console, diagnosis.sentence)
    if not diagnosis.causes:
        return
    table = Table("cause", "where", "parameters (95 % interval)", "confidence", "or else")
    for cause in diagnosis.causes:
        parameters = []
        for name, estimate in cause.parameters.items():
            factor, unit = shown(estimate.unit, estimate.value)
            value, low, high = (
                number(factor * x) for x in (estimate.value, estimate.low, estimate.high)
            )
            parameters.append(f"{name} {value} {unit} ({low} to {high})".replace("  ", " "))
        table.add_row(
            cause.candidate.cause.title,
            one_line(str(cause.candidate.location)),
            "\n".join(parameters),
            percent(cause.confidence),
            ", ".join(cause.equivalent),
        )
    console.print(table, markup=False)


def main(arguments: list[str]) -> int:
    """Run one of the commands; returns the exit code, 2 with one sentence for a wrong study."""
    # One thread for sums: the same seed gives the same bits. Numpy reads it when imported.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    command = tyro.cli(
        Command,
        args=arguments,
        prog="python -m reality_gap",
        description=__doc__,
    )
    from rich.console import Console

    console = Console(soft_wrap=True)
    try:
        match command:
            case Diagnose():
                diagnose(command, console)
            case Check():
                check(command, console)
            case Init():
                init(command, console)
            case Unpack():
                unpack(command, console)
    except (RealityGapError, OSError) as error:
        print(one_line(str(error)), file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        more = "; the same command goes on from there" if isinstance(command, Diagnose) else ""
        print(f"interrupted{more}", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
