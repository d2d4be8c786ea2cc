"""Command line of reality_gap: the console script ``reality-gap``, or ``python -m reality_gap``."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from reality_gap.diagnose_command import Diagnose, considered_causes, options_of
from reality_gap.errors import RealityGapError, StudyError, one_line
from reality_gap.run_command import Run, diagnosis_of, study_of

if TYPE_CHECKING:
    from rich.console import Console

    from reality_gap.diagnosis import Diagnosis

SCRIPT, DISTRIBUTION = "reality-gap", "kengoro"
DESCRIPTION = """Find out from logs what a MuJoCo model of a machine gets wrong.

All at once: run. The usual order is: init, check, diagnose, sample. --version prints the
version.
"""


@dataclass(frozen=True)
class Init:
    """Draft a STUDY.yaml, with columns guessed from their names."""

    model: tyro.conf.Positional[Path]
    """MJCF file of the machine."""
    logs: tyro.conf.Positional[tuple[Path, ...]]
    """One or more CSV or Parquet files."""
    out: Path = Path("STUDY.yaml")
    """File to write; the model and the logs must be in its folder or in folders below."""


@dataclass(frozen=True)
class Check:
    """Check a study: print errors and suspicious data, without a diagnosis."""

    study: tyro.conf.Positional[Path]
    """STUDY.yaml: the model, the logs and the meaning of their columns."""


@dataclass(frozen=True)
class Unpack:
    """Write a ROS bag, an MCAP file or a LeRobot dataset as CSV files, for init."""

    bag: tyro.conf.Positional[Path]
    """A .bag, .mcap or .db3 file, or the folder of a ROS 2 bag or of a LeRobot dataset."""
    out: Path
    """Folder to create."""
    topics: tuple[str, ...] = ()
    """Names of topics, or of features of a dataset; by default all with numbers."""
    arrival: bool = False
    """Use the time at which messages were recorded instead of their stamps."""
    types: Path | None = None
    """Folder of .msg and .idl files, for messages whose definition is not in the bag."""
    episodes: tuple[int, ...] = ()
    """Numbers of episodes of a LeRobot dataset; by default all."""


@dataclass(frozen=True)
class Sample:
    """Write models of what the machine may be, sampled from what a diagnosis leaves open."""

    diagnosis: tyro.conf.Positional[Path]
    """Folder of a diagnosis."""
    out: Path
    """Folder to create; each model gets a folder in it, with extended.xml and extended.json."""
    count: int = 16
    """Number of models."""
    seed: int = 0
    """The same seed gives the same models."""


@dataclass(frozen=True)
class Causes:
    """List the causes that a diagnosis considers, with their parameters."""


Command = (
    Annotated[Init, tyro.conf.subcommand("init")]
    | Annotated[Check, tyro.conf.subcommand("check")]
    | Annotated[Diagnose, tyro.conf.subcommand("diagnose")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Unpack, tyro.conf.subcommand("unpack")]
    | Annotated[Sample, tyro.conf.subcommand("sample")]
    | Annotated[Causes, tyro.conf.subcommand("causes")]
)


def init(command: Init, console: Console) -> None:
    """Write a draft of a study; an existing file is not overwritten."""
    from mjcf_sandbox.files import check_links, write_text
    from reality_gap.io.template import draft_study

    out = command.out
    check_links(out)
    if out.exists():
        raise StudyError(f"{out} exists and is not overwritten; choose another --out")
    if not out.parent.is_dir():
        raise StudyError(f"there is no folder {out.parent} for {out.name}; create it first")
    text = draft_study(
        command.model,
        command.logs,
        out.parent,
        note=lambda sentence: _print(console, f"note: {sentence}"),
    )
    write_text(out, text)
    _print(console, f"wrote {out}; edit it, then run: {_program()} check {out}")


def check(command: Check, console: Console) -> None:
    """Print what is suspicious in a study, or its size if nothing is."""
    from reality_gap.check import causes_without_location, check_study, summary
    from reality_gap.io.loader import load_study
    from reality_gap.simulation.episode import silence

    silence()
    study = load_study(command.study)
    lines = list(check_study(study)) or [f"nothing is wrong with this study: {summary(study)}"]
    missing = causes_without_location(study)
    if missing:
        lines.append(
            f"cannot be diagnosed with this model and log: {', '.join(missing)}; they have no "
            "element or sensor to act on"
        )
    for line in lines:
        _print(console, line)


def diagnose(command: Diagnose, console: Console) -> None:
    """Diagnose a study, write the results and print the verdict."""
    from reality_gap import pipeline
    from reality_gap.check import check_study
    from reality_gap.inference.checkpoint import forget
    from reality_gap.io.loader import load_study
    from reality_gap.report.files import check_out, write_diagnosis
    from reality_gap.report.terminal import shown_progress
    from reality_gap.simulation.episode import silence
    from reality_gap.simulation.memory import GIGABYTE, fit_memory

    options, considered = options_of(command), considered_causes(command)
    check_out(command.out)
    silence()
    study = load_study(command.study)
    notes = check_study(study)
    for sentence in notes:
        _print(console, f"note: {sentence}")
    plan = fit_memory(
        study,
        command.jobs,
        command.memory * GIGABYTE,
        lambda text: _print(console, f"note: {text}"),
        considered,
    )
    work = command.out.absolute().with_name(f".{command.out.name}.work")
    with shown_progress(console) as progress:
        diagnosis = pipeline.diagnose(
            plan.study,
            jobs=plan.jobs,
            causes=considered,
            options=options,
            progress=progress,
            work=work,
        )
    diagnosis = replace(diagnosis, notes=notes)
    write_diagnosis(diagnosis, plan.study, command.out)
    forget(work)
    _print_verdict(diagnosis, console)
    _print(console, f"report: {command.out / 'report.html'}")


def run(command: Run, console: Console) -> None:
    """Draft a study, correct its columns and diagnose it."""
    study = study_of(command, lambda sentence: _print(console, f"note: {sentence}"))
    diagnose(diagnosis_of(command, study), console)


def unpack(command: Unpack, console: Console) -> None:
    """Write the topics of a bag as CSV files."""
    from reality_gap.io.rosbag_sandbox import unpack_in_sandbox
    from reality_gap.report.terminal import shown_progress

    notes: list[str] = []
    with shown_progress(console) as progress:
        paths = unpack_in_sandbox(
            command.bag,
            command.out,
            command.topics,
            command.arrival,
            lambda share: progress(share, "reading"),
            types=command.types,
            episodes=command.episodes,
            note=notes.append,
        )
    for sentence in notes:
        _print(console, f"note: {sentence}")
    for path in paths:
        _print(console, f"wrote {command.out / path.name}")
    _print(console, f"next: {_program()} init MODEL {command.out}/*.csv")


def sample(command: Sample, console: Console) -> None:
    """Write models from the posterior of a diagnosis."""
    from reality_gap.report.files import write_samples
    from reality_gap.report.posterior_file import load_posterior
    from reality_gap.simulation.episode import silence

    silence()
    posterior = load_posterior(command.diagnosis)
    folders = write_samples(posterior, command.count, command.seed, command.out)
    _print(console, f"wrote {folders[0]} to {folders[-1].name}, each with extended.xml")


def causes(console: Console) -> None:
    """Print the catalogue of causes."""
    from reality_gap.report.catalogue import describe_catalogue

    for line in describe_catalogue():
        _print(console, line)


def _print(console: Console, line: str) -> None:
    """Print a line as it is: names in it may come from untrusted files."""
    indent = line[: len(line) - len(line.lstrip(" "))]
    console.print(indent + one_line(line.strip(" ")), markup=False, highlight=False)


def _print_verdict(diagnosis: Diagnosis, console: Console) -> None:
    """Print the sentence of a verdict, its causes, and what the log cannot show."""
    from reality_gap.report.log_text import flat_line, log_lines
    from reality_gap.report.terminal import calibration_line, cause_table
    from reality_gap.report.words import about_notes, about_restarts

    _print(console, diagnosis.sentence)
    if diagnosis.causes:
        console.print(cause_table(diagnosis), markup=False)
    if diagnosis.calibration:
        _print(console, calibration_line(diagnosis, diagnosis.calibration))
    lines = about_restarts(diagnosis), about_notes(diagnosis)
    for line in (*lines, *log_lines(diagnosis), flat_line(diagnosis)):
        if line:
            _print(console, line)


def _program() -> str:
    """Return the command by which this program was started."""
    return SCRIPT if Path(sys.argv[0]).stem == SCRIPT else "python -m reality_gap"


def _version() -> str:
    try:
        return f"{SCRIPT} {version(DISTRIBUTION)}"
    except PackageNotFoundError:
        return f"{SCRIPT}: {DISTRIBUTION} is not installed, so that its version is unknown"


def _run(command: Command, console: Console) -> None:
    match command:
        case Init():
            init(command, console)
        case Check():
            check(command, console)
        case Diagnose():
            diagnose(command, console)
        case Run():
            run(command, console)
        case Unpack():
            unpack(command, console)
        case Sample():
            sample(command, console)
        case Causes():
            causes(console)


def main(arguments: list[str] | None = None) -> int:
    """Run a sub-command.

    Args:
        arguments: those of the command line by default.

    Returns:
        Exit code: 0, 2 after an error, which is printed in one line, or 130 after Ctrl-C.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments == ["--version"]:
        print(_version())
        return 0
    # With one thread, sums have the same order and equal seeds give equal bits. NumPy reads these
    # variables when it is imported.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    command = tyro.cli(Command, args=arguments, prog=_program(), description=DESCRIPTION)
    from rich.console import Console

    try:
        _run(command, Console(soft_wrap=True))
    except (RealityGapError, OSError) as error:
        print(one_line(str(error)), file=sys.stderr)
        return 2
    except RuntimeError as error:
        if "MUJOCO_GL" not in str(error):  # which MuJoCo checks at its import
            raise
        valid = "unset it, or set it to egl, osmesa, glfw or disabled"
        print(f"{one_line(str(error))}: {valid}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        continues = isinstance(command, Diagnose | Run)
        advice = "; run the same command to continue" if continues else ""
        print(f"interrupted{advice}", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
