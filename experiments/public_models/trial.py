"""Trial: a public model, as it is or with a payload, is logged and diagnosed in a process."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.harness.errors import ExperimentError
from experiments.public_models.catalogue import MODELS, find
from experiments.public_models.machine import Machine, make_machine
from experiments.public_models.motion import Motion
from experiments.public_models.study import noise_of, payload_mass, write_study

NULL, PAYLOAD = "null", "payload"
KINDS = (NULL, PAYLOAD)
REFUSED, LATE, BROKEN = "refused", "out of time", "error"
"""Answers of a diagnosis that has no verdict."""
POLL = 0.2
"""Interval at which the process of a diagnosis is looked at [s]."""


def trial(
    name: str, kind: str, folders: tuple[Path, ...], out: Path, seconds: float, limit: float
) -> dict[str, Any]:
    """Make the study of a model and diagnose it.

    Args:
        name: key of the model.
        kind: "null" or "payload".
        folders: the user's folders.
        out: folder of the study and of the diagnosis; an earlier one is replaced.
        seconds: length of the log [s].
        limit: time that the diagnosis may take [s].

    Returns:
        The machine, the truth and the answer, as JSON.
    """
    path = find(MODELS[name], folders)
    assert path is not None, "run.choose leaves out models without a file"
    shutil.rmtree(out, ignore_errors=True)
    seed = sorted(MODELS).index(name)
    found: dict[str, Any] = {"model": name, "kind": kind, "group": MODELS[name].group}
    try:
        machine = make_machine(path, MODELS[name])
        motion = Motion(machine, seed, seconds)
        nominal = motion.log(0.0)
        noise = noise_of(machine, nominal, quantised=seed % 2 == 0)
        mass, effect = (0.0, 0.0) if kind == NULL else payload_mass(motion, noise)
        write_study(out / "study", machine, motion.log(mass), noise, seed + 100 * (kind != NULL))
    except (ExperimentError, ValueError) as error:
        reason = " ".join(str(error).split())
        return found | {"unusable": reason.replace(str(path), MODELS[name].file)}
    found |= traits(machine) | {"touching": nominal.touching, "share": motion.share}
    found |= {"unusable": "", "mass": mass, "effect": effect, "end": machine.end}
    found["end_link"] = end_link(machine)
    return found | diagnosis(out / "study" / "STUDY.yaml", out / "diagnosis", limit)


def end_link(machine: Machine) -> list[str]:
    """Names of the bodies that are welded to the one that carries the payload."""
    model = machine.spec.copy().compile()
    weld = model.body_weldid[model.body(machine.end).id]
    return [str(model.body(b).name) for b in range(model.nbody) if model.body_weldid[b] == weld]


def traits(machine: Machine) -> dict[str, Any]:
    """Size of a machine, and what was changed in its model."""
    model = machine.spec.copy().compile()
    return {
        "joints": int(model.njnt),
        "actuators": int(model.nactuator),
        "tendons": int(model.ntendon),
        "log": "torques" if machine.torques else "commands",
        "notes": list(machine.notes),
    }


def diagnosis(study: Path, out: Path, limit: float) -> dict[str, Any]:
    """Diagnose a study by the command line in a process of its own.

    Returns:
        The answer, the time [s], and the largest memory [MB], as JSON.
    """
    command = [sys.executable, "-m", "reality_gap", "diagnose", str(study)]
    command += ["--out", str(out), "--jobs", "1"]
    begin = time.perf_counter()
    log = study.parent / "printed.txt"
    with log.open("w", encoding="utf-8") as stream:
        code, usage = run_limited(command, stream, limit)
    spent = time.perf_counter() - begin
    text = log.read_text(encoding="utf-8", errors="replace")
    lines = [line for line in text.splitlines() if line.strip()]
    unit = 1024.0**2 if sys.platform == "darwin" else 1024.0
    found = {
        "seconds": round(spent, 1),
        "core_seconds": round(usage.ru_utime + usage.ru_stime, 1),
        "memory": round(usage.ru_maxrss / unit),
        "hints": [line for line in lines if line.startswith("note: ")],
    }
    if code == 0:
        verdict = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
        keys = ("verdict", "sentence", "causes", "rms_before", "rms_after", "rejected", "measures")
        return found | {key: verdict[key] for key in keys}
    if code is None:
        answer, reason = LATE, f"no verdict after {limit:g} s"
    else:
        raw = any(line.startswith("Traceback") for line in lines) or code != 2
        answer, reason = (BROKEN if raw else REFUSED), lines[-1] if lines else f"code {code}"
    none: dict[str, Any] = {
        "causes": [],
        "rms_before": None,
        "rms_after": None,
        "rejected": [],
        "measures": {},
    }
    return found | none | {"verdict": answer, "sentence": reason.replace(str(study.parent), ".")}


def run_limited(command: Sequence[str], stream: Any, limit: float) -> tuple[int | None, Any]:
    """Run a command that is ended after a time.

    Returns:
        Its exit code, None if it was ended, and its usage of resources.
    """
    process = subprocess.Popen(
        command, stdout=stream, stderr=subprocess.STDOUT, start_new_session=True
    )
    end, late = time.monotonic() + limit, False
    while True:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return (None if late else process.returncode), usage
        if not late and time.monotonic() > end:
            late = True
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
        time.sleep(POLL)
