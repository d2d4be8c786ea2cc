"""Trains the joint-muscle mapping from the nominal model (Kawaharazuka et al. 2018, sec. II-A).

Every group is trained on the same random postures of the nominal model, as described in
`jmm_agent.networks.fit`, by torch in a process of its own, see `jmm_agent.mapping.torch_process`. A
trained map is kept in a file whose name is the hash of all that training depends on.
"""

from __future__ import annotations

import hashlib
import logging
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from jmm_agent.mapping.group_map import METRES, GroupMap
from jmm_agent.mapping.joint_muscle_map import FORMAT, CheckpointError, JointMuscleMap
from jmm_agent.mapping.recipe import Recipe, TrainingError
from jmm_agent.mapping.torch_process import TorchProcess
from jmm_agent.nominal_model import NominalModel
from jmm_agent.types import Floats

Progress = Callable[[str, float], None]
"""Called with a group's name and the fraction of its training that is done."""

PROBES = 256
"""Number of postures at which the lengths of a nominal model enter its hash."""

VALIDATION = 5000
"""Number of postures at which a map is validated."""

METHOD = "torch-1"
"""Name of what trains a map from a recipe: what trains other bits keeps them in other files."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class GroupReport:
    """Errors of one trained group.

    Attributes:
        training_rmse: RMSE on postures of the training [m]; for a map from a file as below.
        validation_rmse: RMSE on other postures inside the limits [m].
        history: RMSE over each 250 Adam steps [m]; empty for a map from a file.
        seconds: duration; 0 for a map from a file.
    """

    training_rmse: float
    validation_rmse: float
    history: tuple[float, ...]
    seconds: float


@dataclass(frozen=True)
class TrainingReport:
    """Errors of a trained map.

    Attributes:
        groups: errors by the name of the group.
        seconds: duration of all.
        cached: whether a file was read instead of training.
    """

    groups: dict[str, GroupReport]
    seconds: float
    cached: bool


def train(
    nominal: NominalModel, seed: int, recipe: Recipe | None = None, progress: Progress | None = None
) -> tuple[JointMuscleMap, TrainingReport]:
    """Train the map of every group from the nominal model (sec. II-A).

    The same seed makes the same bits on the same kind of processor, with any number of cores.

    Args:
        nominal: the nominal model.
        seed: of the postures and the initial layers.
        recipe: options of training; the defaults if left out.
        progress: called with the name of a group and the share of its training that is done.

    Returns:
        The map, and its errors.

    Raises:
        TrainingError: lengths of the nominal model are not finite, training diverged, or the
            process that runs torch has failed.
    """
    recipe = recipe or Recipe()
    begin = time.perf_counter()
    data_rng, *group_rngs = _generators(nominal, seed)
    centre, scale = _box(nominal)
    groups, histories, seconds = [], [], []
    with TorchProcess() as process:
        x, lengths = _sample(nominal, data_rng, recipe.samples, 1.0 + recipe.margin)
        for (name, joints, muscles), rng in zip(nominal.topology(), group_rngs, strict=True):
            started = time.perf_counter()
            layers, history = process.call(
                "jmm_agent.networks.fit:fit",
                x[:, joints],
                lengths[:, muscles] / METRES,
                rng,
                recipe,
                progress=partial(_report, progress, name),
            )
            groups.append(GroupMap(name, joints, muscles, centre[joints], scale[joints], *layers))
            histories.append(history)
            seconds.append(time.perf_counter() - started)
    jmm = JointMuscleMap(nominal.joints, nominal.muscles, tuple(groups))
    fitted = _rmse(jmm, centre + scale * x[:VALIDATION], lengths[:VALIDATION])
    reports = {
        group.name: GroupReport(training, validation, history, taken)
        for group, training, validation, history, taken in zip(
            groups, fitted, _validate(jmm, nominal, seed), histories, seconds, strict=True
        )
    }
    return jmm, TrainingReport(reports, time.perf_counter() - begin, cached=False)


def load_or_train(
    nominal: NominalModel,
    seed: int,
    cache_dir: str | os.PathLike[str],
    recipe: Recipe | None = None,
    progress: Progress | None = None,
) -> tuple[JointMuscleMap, TrainingReport]:
    """Read the map that `train` returns from a file, or train it and write the file.

    A broken file is logged, and the map is trained again. A folder that cannot be written is
    logged; the map is still returned.

    Args:
        nominal: the nominal model.
        seed: of the postures and the initial layers.
        cache_dir: folder of trained maps.
        recipe: options of training; the defaults if left out.
        progress: called with the name of a group and the share of its training that is done.

    Returns:
        The map, and its errors.

    Raises:
        TrainingError: lengths of the nominal model are not finite, training diverged, or the
            process that runs torch has failed.
    """
    recipe = recipe or Recipe()
    path = Path(cache_dir) / f"jmm-{content_hash(nominal, seed, recipe)}.npz"
    if path.exists():
        begin = time.perf_counter()
        try:
            jmm = JointMuscleMap.load(path)
            if (jmm.joints, jmm.muscles) != (nominal.joints, nominal.muscles):
                raise CheckpointError(f"Checkpoint {path}: it holds the map of another robot.")
            errors = _validate(jmm, nominal, seed)
            reports = {
                group.name: GroupReport(error, error, (), 0.0)
                for group, error in zip(jmm.groups, errors, strict=True)
            }
            return jmm, TrainingReport(reports, time.perf_counter() - begin, cached=True)
        except CheckpointError as error:
            _log.warning("%s The map is trained again.", error)
    jmm, report = train(nominal, seed, recipe, progress)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        jmm.save(path)
    except OSError as error:
        _log.warning("The trained map could not be kept in %s: %s.", path, error)
    return jmm, report


def content_hash(nominal: NominalModel, seed: int, recipe: Recipe) -> str:
    """Hexadecimal digest of all that training depends on.

    Args:
        nominal: the nominal model, whose lengths enter at `PROBES` postures.
        seed: of training.
        recipe: options of training.
    """
    x, lengths = _sample(nominal, np.random.default_rng(0), PROBES, 1.0)
    named = (FORMAT, METHOD, seed, nominal.joints, nominal.muscles, nominal.groups, asdict(recipe))
    digest = hashlib.sha256(repr(named).encode())
    for array in (nominal.lower, nominal.upper, nominal.crosses, x, lengths):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:24]


def _report(progress: Progress | None, name: str, done: float) -> None:
    if progress is not None:
        progress(name, done)


def _generators(nominal: NominalModel, seed: int) -> list[np.random.Generator]:
    sequences = np.random.SeedSequence(seed).spawn(1 + len(nominal.groups))
    return [np.random.default_rng(sequence) for sequence in sequences]


def _box(nominal: NominalModel) -> tuple[Floats, Floats]:
    """Centre and half range of the joint limits [rad], each (n,)."""
    return (nominal.upper + nominal.lower) / 2.0, (nominal.upper - nominal.lower) / 2.0


def _sample(
    nominal: NominalModel, rng: np.random.Generator, count: int, reach: float
) -> tuple[Floats, Floats]:
    """Postures (count, n) scaled so that the limits are -1 and 1, and lengths (count, m) [m]."""
    centre, scale = _box(nominal)
    x = rng.uniform(-reach, reach, (count, len(nominal.joints)))
    lengths = np.asarray(nominal.lengths(centre + scale * x), dtype=np.float64)
    if not np.isfinite(lengths).all():
        raise TrainingError("Nominal model: lengths are not finite near the joint limits.")
    return x, lengths


def _validate(jmm: JointMuscleMap, nominal: NominalModel, seed: int) -> list[float]:
    """RMSE [m] by group on postures that are not those of training."""
    x, lengths = _sample(nominal, np.random.default_rng([seed, VALIDATION]), VALIDATION, 1.0)
    centre, scale = _box(nominal)
    return _rmse(jmm, centre + scale * x, lengths)


def _rmse(jmm: JointMuscleMap, q: Floats, lengths: Floats) -> list[float]:
    square = np.square(jmm.lengths(q) - lengths)
    return [float(np.sqrt(square[:, group.muscle_index].mean())) for group in jmm.groups]
