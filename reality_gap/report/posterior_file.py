"""posterior.json: what a diagnosis leaves open, of which models can be sampled again.

Keys of the file, with all numbers in SI units:

    model                 name of the file of the nominal model, nominal.xml
    study                 name, duration [s], settle [s], absolute_encoders, channels: sensor and
                          kind of each, and uses: speed, force and travel of each joint (`JointUse`)
    usual                 effects of all machines: candidates as below
    branches              hypotheses, the likeliest first:
        weight            probability
        candidates        cause, kind, elements, note, and log if it acts in one log only;
                          parameters: name, unit, value, null, scale, low, high
        covariance        of all parameters in scales from their null values: the rows of its lower
                          triangle, up to the diagonal
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location, Parameter
from reality_gap.causes.support.typical_scales import joint_uses
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.extended import names
from reality_gap.io.loader import MAX_STEPS
from reality_gap.posterior import Branch, Posterior
from reality_gap.report.verdict_json import location_json
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, Part
from reality_gap.study.data import (
    Channel,
    Episode,
    Initial,
    JointUse,
    Study,
    load_spec,
    load_untrusted_spec,
)
from reality_gap.study.system import System, commanded, compile_system
from reality_gap.types import Floats

JSON, MODEL = "posterior.json", "nominal.xml"
KINDS = ("tendon", "joint", "site", "body", "sensor", "actuator", "camera", "model")
NUMBERS = ("value", "null", "scale", "low", "high")


def posterior_json(posterior: Posterior) -> dict[str, Any]:
    """Return the content of posterior.json."""
    study = posterior.system.study
    return {
        "model": MODEL,
        "study": {
            "name": study.name,
            "duration": study.duration,
            "settle": study.initial.settle,
            "absolute_encoders": study.absolute_encoders,
            "channels": [{"sensor": c.sensor, "kind": c.kind} for c in study.channels],
            "uses": {joint: use._asdict() for joint, use in joint_uses(posterior.system).items()},
        },
        "usual": _parts_json(posterior.usual),
        "branches": [
            {
                "weight": branch.weight,
                "candidates": _parts_json(branch.hypothesis),
                "covariance": [row[: i + 1] for i, row in enumerate(branch.covariance.tolist())],
            }
            for branch in posterior.branches
        ],
    }


def nominal_xml(system: System) -> str:
    """Return the nominal model as MJCF, with the time step of replays.

    MuJoCo writes the spring lengths that its compiler found. Where the model leaves them to the
    compiler they are left out, so that they follow what a sample changes, as they did before.
    """
    spec = system.study.spec()
    spec.option.timestep = float(system.model.opt.timestep)
    left = [max(tendon.springlength) < 0.0 for tendon in spec.tendons]
    root = ElementTree.fromstring(spec.to_xml())
    elements = [element for section in root.iter("tendon") for element in section]
    for element, own in zip(elements, left, strict=True):
        if own:
            element.attrib.pop("springlength", None)
    return ElementTree.tostring(root, encoding="unicode")


def write_posterior(posterior: Posterior, path: Path) -> None:
    """Write posterior.json."""
    text = json.dumps(posterior_json(posterior), ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def load_posterior(folder: Path | str) -> Posterior:
    """Load what a diagnosis leaves open.

    ``load_posterior(folder).sample(n, seed)`` are the models that `Diagnosis.sample` returned.

    Args:
        folder: the folder of a diagnosis.

    Raises:
        StudyError: there is no posterior in the folder, as after an unexplained gap.
        UnknownNameError: it needs a cause that is not in the catalogue.
    """
    if not isinstance(folder, str | Path):
        raise StudyError(f"the folder of a diagnosis must be a path, not {folder!r}")
    folder = Path(folder)
    path = folder / JSON
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["model"] != MODEL:
            raise StudyError(f"{path} names the model {content['model']!r} instead of {MODEL}")
        load_untrusted_spec(folder / MODEL, folder)
        system = compile_system(_study(content["study"], folder / MODEL))
        branches = tuple(_branch(entry) for entry in content["branches"])
        if not branches:
            raise ValueError("there are no branches")
        posterior = Posterior(system, _parts(content["usual"]), branches)
        _check(posterior)
        return posterior
    except (FileNotFoundError, IsADirectoryError, NotADirectoryError) as error:
        raise StudyError(
            f"no {JSON} in {folder}; give the folder of a diagnosis that is not unexplained"
        ) from error
    except (StudyError, UnknownNameError):
        raise
    except (LookupError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        raise StudyError(f"{path} was not written by a diagnosis: {error!r}") from error


def _check(posterior: Posterior) -> None:
    """Refuse a posterior with unknown elements, or one of which no sample can be built."""
    spec = load_spec(posterior.system.study.model)
    known = {kind: set(names(kind, spec)) for kind in KINDS}
    hypotheses = [posterior.usual, *(branch.hypothesis for branch in posterior.branches)]
    for candidate, _ in (part for hypothesis in hypotheses for part in hypothesis):
        kind, elements = candidate.location.kind, set(candidate.location.elements)
        if kind != "model" and not elements <= known[kind]:
            raise ValueError(f"the model has no {kind} {min(elements - known[kind])}")
    for branch in posterior.branches:
        replace(posterior, branches=(branch,)).sample(1)


def _parts_json(hypothesis: Hypothesis) -> list[dict[str, Any]]:
    return [
        {
            "cause": candidate.cause.id,
            **location_json(candidate.location),
            "parameters": [_parameter_json(p, values[p.name]) for p in candidate.parameters],
        }
        for candidate, values in hypothesis
    ]


def _parameter_json(p: Parameter, value: float) -> dict[str, Any]:
    numbers = (float(value), p.null, p.scale, p.low, p.high)
    return {"name": p.name, "unit": p.unit, **dict(zip(NUMBERS, map(float, numbers), strict=True))}


def _parts(entries: list[dict[str, Any]]) -> list[Part]:
    return [_part(entry) for entry in entries]


def _part(entry: dict[str, Any]) -> Part:
    elements = entry["elements"]
    if not isinstance(elements, list) or not elements or not entry["parameters"]:
        raise ValueError(f"the cause {entry['cause']} has no list of elements or no parameters")
    location = Location(
        entry["kind"], tuple(map(str, elements)), entry["note"], entry.get("log", "")
    )
    parameters, values = [], {}
    for one in entry["parameters"]:
        value, null, scale, low, high = (float(one[name]) for name in NUMBERS)
        if not np.all(np.isfinite((value, null, scale))) or scale == 0.0 or not low <= high:
            raise ValueError(f"the parameter {one['name']} has no finite values")
        if not low - abs(scale) <= value <= high + abs(scale):
            raise ValueError(f"the parameter {one['name']} is out of its bounds")
        name, unit = str(one["name"]), str(one["unit"])
        parameters.append(Parameter(name, unit, scale, 0.0, low, high, null))
        values[name] = value
    return Candidate(find_cause(entry["cause"]), location, tuple(parameters)), values


def _branch(entry: dict[str, Any]) -> Branch:
    hypothesis, weight = _parts(entry["candidates"]), float(entry["weight"])
    size = sum(len(candidate.parameters) for candidate, _ in hypothesis)
    covariance = _symmetric(entry["covariance"], size)
    if not 0.0 < weight <= 1.0:
        raise ValueError(f"the weight of a branch is {weight}")
    return Branch(hypothesis, covariance, weight)


def _symmetric(rows: list[list[float]], size: int) -> Floats:
    """Return a matrix (size, size) from the rows of its lower triangle."""
    if [len(row) for row in rows] != list(range(1, size + 1)):
        raise ValueError(f"the covariance is not the lower triangle of {size} rows")
    found = np.zeros((size, size))
    for i, row in enumerate(rows):
        found[i, : i + 1] = found[: i + 1, i] = row
    if not np.all(np.isfinite(found)) or np.any(np.diag(found) < 0.0):
        raise ValueError("the covariance is not finite and positive")
    return found


def _uses(entry: dict[str, Any], model: mujoco.MjModel) -> dict[str, JointUse]:
    """Return the uses of joints; a file that is older has none."""
    found = {}
    for joint, one in entry.get("uses", {}).items():
        model.joint(joint)  # KeyError if there is none
        use = JointUse(float(one["speed"]), float(one["force"]), float(one.get("travel", 0.0)))
        if not (use.speed > 0.0 < use.force and use.travel >= 0.0 and np.all(np.isfinite(use))):
            raise ValueError(f"the use of the joint {joint} is {use}")
        found[joint] = use
    return found


def _study(entry: dict[str, Any], model: Path) -> Study:
    """Return a study without readings, from which the same causes can be built."""
    channels = tuple(
        Channel(str(i), str(one["sensor"]), kind=one["kind"])
        for i, one in enumerate(entry["channels"])
    )
    compiled = load_spec(model).compile()
    for channel in channels:
        kind = {"sensor": "sensor", "effort": "joint"}[channel.kind]
        getattr(compiled, kind)(channel.sensor)  # KeyError if there is none
    duration, settle = float(entry["duration"]), float(entry["settle"])
    if not 0.0 < duration < np.inf or not 0.0 <= settle <= MAX_STEPS * compiled.opt.timestep:
        raise ValueError(f"the duration is {duration:g} s, and settle {settle:g} s")
    time = np.array([0.0, duration])
    command = np.zeros((2, len(commanded(compiled))))
    return Study(
        str(entry["name"]),
        model,
        channels,
        (Episode("", time, command, ()),),
        Initial(settle=settle),
        bool(entry["absolute_encoders"]),
        _uses(entry, compiled),
    )
