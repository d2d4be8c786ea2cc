"""Trial of one machine: its diagnosis and its baselines, scored on the same held-out readings."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from experiments.real_machines.baselines import Baseline, fit, fit_by_mujoco
from experiments.real_machines.machines import MACHINES, PERSON_NAME, Machine
from experiments.real_machines.parameters import predict
from jmm_agent.types import Floats
from reality_gap import Diagnosis, Options, RealityGapError, diagnose, load_calibrated
from reality_gap.report.files import check_out, write_diagnosis
from reality_gap.simulation.episode import silence
from reality_gap.simulation.inverse_dynamics import ensure_prepared
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, measured
from reality_gap.study.splits import REPORT, split

NOMINAL, EXTENDED, PUBLISHED = "nominal model", "named causes", "authors"
CALIBRATED = "calibrated model"
MUJOCO = "mujoco.sysid"


def trial(name: str, data: Path, out: Path, seconds: float) -> dict[str, Any]:
    """Diagnose one machine and fit its baselines; write the diagnosis.

    Args:
        name: key of the machine.
        data: the user's folder.
        out: folder of the results; the study and the diagnosis get a folder each.
        seconds: longest log [s].

    Returns:
        The answer, the held-out errors and the signals, as JSON; with ``refused``, one sentence, if
        the files or the study cannot be used.
    """
    machine = MACHINES[name]
    try:
        study = ensure_prepared(machine.study(data, out / "study", seconds))
        check_out(out / "diagnosis")
        found = diagnose(study, options=Options(suggest=False))
        write_diagnosis(found, study, out / "diagnosis")
        baselines = fit_baselines(machine, study)
    except (ValueError, RealityGapError) as error:  # of the loaders, and of the study
        return {"refused": f"{machine.title} is left out: {error}"}
    readings = measured(study)
    predictions = {
        NOMINAL: np.concatenate([trace.before for trace in found.traces]),
        EXTENDED: np.concatenate([trace.after for trace in found.traces]),
    } | {title: baseline.prediction for title, baseline in baselines.items()}
    if found.calibration is not None:
        predictions[CALIBRATED] = load_calibrated(out / "diagnosis").replay(study).prediction
    if machine.published is not None:
        predictions[PUBLISHED] = predict(study, readings, machine.published)
    errors = {key: held_out_errors(study, readings, x) for key, x in predictions.items()}
    return {
        "refused": "",
        "title": machine.title,
        "seconds": study.duration,
        "errors": errors,
        "ratio": ratio(errors, EXTENDED, list(baselines)),
        "calibrated": ratio(errors, CALIBRATED, list(baselines)) if CALIBRATED in errors else None,
        "baselines": {title: dict(baseline.values) for title, baseline in baselines.items()},
        "signals": signals(study, readings, predictions),
        **answer(found),
    }


def fit_baselines(machine: Machine, study: Study) -> dict[str, Baseline]:
    """Fit all baselines of a machine; that of a person by `mujoco.sysid`, too."""
    found = dict[str, Baseline]()
    with _silenced():
        for title, kinds in machine.baselines.items():
            found[title] = fit(study, kinds, machine.shared)
        if PERSON_NAME in found:
            found[MUJOCO] = fit_by_mujoco(study, machine.baselines[PERSON_NAME], machine.shared)
    return found


@contextmanager
def _silenced() -> Iterator[None]:
    """Keep MuJoCo from warning of trial values with which a replay diverges."""
    before = mujoco.get_mju_user_warning()
    silence()
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def held_out_errors(study: Study, readings: Measured, prediction: Floats) -> dict[str, float]:
    """RMS error on the report split by channel in its unit, and of all together in noises."""
    error, held_out = prediction - readings.value, split(readings) == REPORT
    found = {
        f"{channel.name} [{channel.unit}]": _rms(error[held_out & (readings.channel == c)])
        for c, channel in enumerate(study.channels)
    }
    return found | {"all": _rms((error / readings.noise)[held_out])}


def ratio(errors: dict[str, dict[str, float]], key: str, baselines: list[str]) -> float:
    """Held-out error of a model over that of the best baseline."""
    return errors[key]["all"] / min(errors[baseline]["all"] for baseline in baselines)


def _rms(error: Floats) -> float:
    return float(np.sqrt(np.mean(error**2)))


def answer(found: Diagnosis) -> dict[str, Any]:
    """Verdict, named causes and best attempt of a diagnosis, as JSON."""
    return {
        "verdict": found.verdict.value,
        "sentence": found.sentence,
        "causes": [
            {
                "cause": cause.candidate.cause.id,
                "location": str(cause.candidate.location),
                "confidence": cause.confidence,
                "equivalent": list(cause.equivalent),
                "parameters": {
                    name: {"value": e.value, "low": e.low, "high": e.high, "unit": e.unit}
                    for name, e in cause.parameters.items()
                },
            }
            for cause in found.causes
        ],
        "rejected": [
            {
                "cause": one.candidate.cause.id,
                "location": str(one.candidate.location),
                "values": dict(one.values),
                "reason": one.reason,
            }
            for one in found.rejected
        ],
        "depends_on": [[d.quantity, d.fraction] for d in found.depends_on],
        "noises": [found.rms_before, found.rms_after, found.noise_floor],
        "diagnosis_seconds": found.seconds,
    }


def signals(
    study: Study, readings: Measured, predictions: dict[str, Floats]
) -> list[dict[str, Any]]:
    """Measured and predicted signals of each channel in each episode, for pictures."""
    found = []
    for e, episode in enumerate(study.episodes):
        for c, channel in enumerate(study.channels):
            at = (readings.episode == e) & (readings.channel == c)
            if at.any():
                found.append(
                    {
                        "episode": episode.name,
                        "channel": channel.name,
                        "unit": channel.unit,
                        "time": readings.time[at].tolist(),
                        "held_out": (split(readings)[at] == REPORT).tolist(),
                        "measured": readings.value[at].tolist(),
                        "predicted": {key: x[at].tolist() for key, x in predictions.items()},
                    }
                )
    return found
