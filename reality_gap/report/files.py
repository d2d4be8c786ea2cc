"""Files: writes the results of a diagnosis, either all of them or none."""

from __future__ import annotations

import csv
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mjcf_sandbox.errors import OutputError
from mjcf_sandbox.files import check_links
from reality_gap.check import check_study
from reality_gap.diagnosis import Diagnosis, Experiment
from reality_gap.errors import StudyError
from reality_gap.posterior import Posterior
from reality_gap.report import extended_model, model_assets, posterior_file
from reality_gap.report.html import write_report
from reality_gap.report.verdict_json import verdict_json
from reality_gap.study.data import Study

VERDICT, REPORT, EXPERIMENT = "verdict.json", "report.html", "next_experiment.csv"
WRITTEN = {
    VERDICT,
    REPORT,
    EXPERIMENT,
    extended_model.XML,
    extended_model.JSON,
    extended_model.CALIBRATED_XML,
    extended_model.CALIBRATED_JSON,
    posterior_file.JSON,
    posterior_file.MODEL,
    model_assets.FOLDER,
}
"""Names that a diagnosis may write; a folder with other names is not overwritten."""


def check_out(out: Path) -> None:
    """Check that a diagnosis can be written to a folder.

    Args:
        out: the folder; it must not exist, be empty, or contain an earlier diagnosis only.

    Raises:
        StudyError: it is a file, or a folder with other files, or lies behind a link that leads
            nowhere.
    """
    try:
        check_links(out)
    except OutputError as error:
        raise StudyError(str(error)) from error
    if not out.exists():
        return
    if not out.is_dir():
        raise StudyError(f"{out} is a file; choose a folder")
    names = {path.name for path in out.iterdir()}
    foreign = sorted(names - WRITTEN)
    if names and (foreign or VERDICT not in names):
        what = foreign[0] if foreign else sorted(names)[0]
        raise StudyError(
            f"{out} contains {what}, so that it is not an earlier diagnosis and is not "
            "overwritten; choose a new or empty folder"
        )


def write_diagnosis(diagnosis: Diagnosis, study: Study, out: Path | str) -> None:
    """Write verdict.json, extended.xml, extended.json, report.html and next_experiment.csv.

    Unless the gap is unexplained, posterior.json and nominal.xml are written, too; see
    `load_posterior`. A calibrated model, if there is one, is written to calibrated.xml and
    calibrated.json; see `load_calibrated`. An earlier diagnosis in ``out`` is replaced when the new
    one is complete. Without a next experiment there is no next_experiment.csv.

    verdict.json and report.html have notes on what is suspicious in the study.

    Args:
        diagnosis: the results; the study is checked if these have no notes.
        study: the study that was diagnosed.
        out: folder to write; see `check_out`.

    Raises:
        StudyError: ``out`` cannot be used, or the extended model cannot be loaded.
    """
    out = Path(out)
    check_out(out)
    out = out.resolve()
    out.parent.mkdir(parents=True, exist_ok=True)
    if diagnosis.notes is None:
        diagnosis = replace(diagnosis, notes=check_study(study))
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as temporary:
        new = Path(temporary) / "new"
        new.mkdir()
        _write_json(new / VERDICT, verdict_json(diagnosis))
        model, extended = study.model, new / extended_model.XML
        copied = model_assets.write_model(diagnosis.extended_xml, model, extended)
        _write_json(new / extended_model.JSON, extended_model.extension_json(diagnosis.effects))
        if diagnosis.calibration is not None:
            xml, name = diagnosis.calibration.xml, extended_model.CALIBRATED_XML
            model_assets.write_model(xml, model, new / name, copied)
            effects = extended_model.extension_json(diagnosis.calibration.effects, name)
            _write_json(new / extended_model.CALIBRATED_JSON, effects)
        if diagnosis.posterior is not None:
            nominal = posterior_file.nominal_xml(diagnosis.posterior.system)
            model_assets.write_model(nominal, model, new / posterior_file.MODEL, copied)
            posterior_file.write_posterior(diagnosis.posterior, new / posterior_file.JSON)
        if diagnosis.next_experiment is not None:
            write_experiment(diagnosis.next_experiment, study, new / EXPERIMENT)
        write_report(diagnosis, study, new / REPORT)
        _replace(out, new, Path(temporary) / "old")


def write_samples(posterior: Posterior, n: int, seed: int, out: Path | str) -> list[Path]:
    """Write samples of a posterior, each to a folder from which `load_extended` reads it.

    Args:
        posterior: what a diagnosis leaves open.
        n: number of samples.
        seed: of the samples.
        out: folder to create, or an empty one.

    Returns:
        The folders, ``sample_000`` and so on.

    Raises:
        StudyError: ``out`` cannot be used, or a number is out of its range.
    """
    out, original = Path(out), posterior.system.study.model
    if out.is_dir() and any(out.iterdir()):
        raise StudyError(f"{out} is not empty; choose a new or empty folder")
    if any(parent.is_file() for parent in out.parents):
        raise StudyError(f"{out} is in a file; choose a folder in a folder")
    check_out(out)
    samples = posterior.sample(n, seed)
    folders = [out / f"sample_{i:03d}" for i in range(len(samples))]
    for sample, folder in zip(samples, folders, strict=True):
        folder.mkdir(parents=True)
        model_assets.write_model(sample.spec.to_xml(), original, folder / extended_model.XML)
        _write_json(folder / extended_model.JSON, extended_model.effects_json(sample.effects))
    return folders


def write_experiment(experiment: Experiment, study: Study, path: Path) -> None:
    """Write the commands of an experiment as CSV: time [s], then each actuator in SI units."""
    actuators = [actuator.name for actuator in study.spec().actuators]
    table = np.column_stack([experiment.time, experiment.command])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *actuators])
        writer.writerows([[f"{cell:.9g}" for cell in row] for row in table])


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def _replace(out: Path, new: Path, old: Path) -> None:
    """Move ``out`` to ``old`` and ``new`` to ``out``; restore ``out`` if that fails."""
    if not out.exists():
        new.rename(out)
        return
    out.rename(old)
    try:
        new.rename(out)
    except OSError:
        old.rename(out)
        raise
