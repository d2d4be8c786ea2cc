"""Training the joint-muscle mapping from the drawing (Kawaharazuka et al. 2018, sec. II-A).

Every group is trained on the same random postures of the drawing; `jmm_agent.mapping.network_fit`
says how. A trained map is cached by the content of all that it depends on.
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

from jmm_agent.mapping.joint_muscle_map import (
    FORMAT,
    METRES,
    CheckpointError,
    GroupMap,
    JointMuscleMap,
)
from jmm_agent.mapping.network_fit import Recipe, TrainingError, fit
from jmm_agent.nominal_model import NominalModel
from jmm_agent.types import Floats

Progress = Callable[[str, float], None]
"""Called with a group's name and the fraction of its training that is done."""

PROBES = 256
VALIDATION = 5000

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class GroupReport:
    """How the training of one group went.

    Attributes:
        training_rmse: [m] on postures of the training; for a map from the cache as below.
        validation_rmse: [m] on fresh postures inside the limits.
        history: RMSE [m] over each 250 Adam steps; empty for a map from the cache.
        seconds: time taken; 0 for a map from the cache.
    """

    training_rmse: float
    validation_rmse: float
    history: tuple[float, ...]
    seconds: float


@dataclass(frozen=True)
class TrainingReport:
    """How training went, by group; `seconds` in all, `cached` when a file was read instead."""

    groups: dict[str, GroupReport]
    seconds: float
    cached: bool


def train(
    drawing: NominalModel, seed: int, recipe: Recipe | None = None, progress: Progress | None = None
) -> tuple[JointMuscleMap, TrainingReport]:
    """Train the map of every group from the drawing.

    The same seed gives the same bits, as long as BLAS runs on the same number of threads.

    Raises:
        TrainingError: the drawing's lengths are not finite, or training diverged.
    """
    recipe = recipe or Recipe()
    begin = time.perf_counter()
    data_rng, *group_rngs = _generators(drawing, seed)
    x, lengths = _sample(drawing, data_rng, recipe.samples, 1.0 + recipe.margin)
    centre, scale = _box(drawing)
    groups, histories, seconds = [], [], []
    for topology, rng in zip(drawing.topology(), group_rngs, strict=True):
        started = time.perf_counter()
        name, joints, muscles = topology
        weights, history = fit(
            x[:, joints], lengths[:, muscles] / METRES, rng, recipe, partial(_tell, progress, name)
        )
        groups.append(GroupMap(name, joints, muscles, centre[joints], scale[joints], *weights))
        histories.append(history)
        seconds.append(time.perf_counter() - started)
    jmm = JointMuscleMap(drawing.joints, drawing.muscles, tuple(groups))
    fitted = _rmse(jmm, centre + scale * x[:VALIDATION], lengths[:VALIDATION])
    reports = {
        group.name: GroupReport(training, validation, history, taken)
        for group, training, validation, history, taken in zip(
            groups, fitted, _validate(jmm, drawing, seed), histories, seconds, strict=True
        )
    }
    return jmm, TrainingReport(reports, time.perf_counter() - begin, cached=False)


def load_or_train(
    drawing: NominalModel,
    seed: int,
    cache_dir: str | os.PathLike[str],
    recipe: Recipe | None = None,
    progress: Progress | None = None,
) -> tuple[JointMuscleMap, TrainingReport]:
    """The map that `train` gives, read from `cache_dir` when the same was trained before.

    A file's name is the hash of all that training depends on. A broken file is logged and trained
    anew; a directory that cannot be written is logged, and the map returned all the same.
    """
    recipe = recipe or Recipe()
    path = Path(cache_dir) / f"jmm-{content_hash(drawing, seed, recipe)}.npz"
    if path.exists():
        begin = time.perf_counter()
        try:
            jmm = JointMuscleMap.load(path)
            if (jmm.joints, jmm.muscles) != (drawing.joints, drawing.muscles):
                raise CheckpointError(f"Checkpoint {path}: it holds the map of another robot.")
            errors = _validate(jmm, drawing, seed)
            reports = {
                group.name: GroupReport(error, error, (), 0.0)
                for group, error in zip(jmm.groups, errors, strict=True)
            }
            return jmm, TrainingReport(reports, time.perf_counter() - begin, cached=True)
        except CheckpointError as error:
            _log.warning("%s The map is trained anew.", error)
    jmm, report = train(drawing, seed, recipe, progress)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        jmm.save(path)
    except OSError as error:
        _log.warning("The trained map could not be kept in %s: %s.", path, error)
    return jmm, report


def content_hash(drawing: NominalModel, seed: int, recipe: Recipe) -> str:
    """Hexadecimal digest of the drawing (by its lengths at 256 postures), recipe and seed."""
    x, lengths = _sample(drawing, np.random.default_rng(0), PROBES, 1.0)
    named = (FORMAT, seed, drawing.joints, drawing.muscles, drawing.groups, asdict(recipe))
    digest = hashlib.sha256(repr(named).encode())
    for array in (drawing.lower, drawing.upper, drawing.crosses, x, lengths):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:24]


def _tell(progress: Progress | None, name: str, done: float) -> None:
    if progress is not None:
        progress(name, done)


def _generators(drawing: NominalModel, seed: int) -> list[np.random.Generator]:
    children = np.random.SeedSequence(seed).spawn(1 + len(drawing.groups))
    return [np.random.default_rng(child) for child in children]


def _box(drawing: NominalModel) -> tuple[Floats, Floats]:
    """Centre and half range of the joint limits [rad], each (n,)."""
    return (drawing.upper + drawing.lower) / 2.0, (drawing.upper - drawing.lower) / 2.0


def _sample(
    drawing: NominalModel, rng: np.random.Generator, count: int, reach: float
) -> tuple[Floats, Floats]:
    """Postures (count, n) scaled so that the limits are -1 and 1, and lengths (count, m) [m]."""
    centre, scale = _box(drawing)
    x = rng.uniform(-reach, reach, (count, len(drawing.joints)))
    lengths = np.asarray(drawing.lengths(centre + scale * x), dtype=np.float64)
    if not np.isfinite(lengths).all():
        raise TrainingError("The drawing's lengths are not finite near the joint limits.")
    return x, lengths


def _validate(jmm: JointMuscleMap, drawing: NominalModel, seed: int) -> list[float]:
    """RMSE [m] by group on postures that no training has seen."""
    x, lengths = _sample(drawing, np.random.default_rng([seed, VALIDATION]), VALIDATION, 1.0)
    centre, scale = _box(drawing)
    return _rmse(jmm, centre + scale * x, lengths)


def _rmse(jmm: JointMuscleMap, q: Floats, lengths: Floats) -> list[float]:
    square = np.square(jmm.lengths(q) - lengths)
    return [float(np.sqrt(square[:, group.muscle_index].mean())) for group in jmm.groups]
