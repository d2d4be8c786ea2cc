"""What displaced points of attachment do to muscle lengths, by the hidden units of a map.

A muscle of the actual robot is not attached where it is drawn. If point number p of muscle m is
displaced by u along an axis of its bone, the length at a posture theta changes by u J_mp(theta),
which the nominal model knows. The hidden activities h of a trained map follow J, too:

    J_mp(theta) ~ c_mp + W_mp h(theta),

by least squares over random postures. So the change of the output layer that such an error makes is
u W_mp, and a prior of it says what the prior of an output layer alone cannot: which of all smooth
functions of the posture the error of a length usually is.
"""

from __future__ import annotations

import hashlib
import logging
import os
from pathlib import Path

import numpy as np

from jmm_agent.mapping.array_file import MIB, ArrayFileError, read_arrays, write_arrays
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap, fingerprint
from jmm_agent.mapping.prior import PointWeights
from jmm_agent.nominal_model import NominalModel
from jmm_agent.types import Floats

POSTURES = 2000
"""Number of random postures."""
REGULARISATION = 1e-6
"""Square of the smallest activity that counts [1]."""
PROBES = 4
"""Number of postures at which what points do enters the name of a file."""
LARGEST = 512 * MIB
"""Largest file, unfolded [bytes]; that of Kengoro's arm has less than 3 MiB."""

_log = logging.getLogger(__name__)


def point_weights(jmm: JointMuscleMap, nominal: NominalModel) -> PointWeights | None:
    """Weights of a map's hidden units in what displaced points do (module docstring).

    Args:
        jmm: the map that was trained on the nominal model.
        nominal: the nominal model.

    Returns:
        For each group (muscles, H, P) [1]; None if the model does not know what its points do, or
        has other joints or not all muscles.
    """
    known = nominal.points
    if (
        known is None
        or jmm.joints != nominal.joints
        or not set(jmm.muscles) <= set(nominal.muscles)
    ):
        return None
    rng = np.random.default_rng(0)
    postures = rng.uniform(nominal.lower, nominal.upper, (POSTURES, len(nominal.joints)))
    changes = known(postures)[:, [nominal.muscles.index(muscle) for muscle in jmm.muscles]]
    found = []
    for group in jmm.groups:
        hidden, own = group.hidden(postures), changes[:, group.muscle_index]
        hidden = hidden - hidden.mean(axis=0)
        matrix = hidden.T @ hidden
        matrix[np.diag_indices_from(matrix)] += REGULARISATION * POSTURES
        flat = (own - own.mean(axis=0)).reshape(POSTURES, -1)
        weights = np.linalg.solve(matrix, hidden.T @ flat).reshape(-1, *own.shape[1:])
        found.append(np.ascontiguousarray(weights.transpose(1, 0, 2)))
    return tuple(found)


def load_or_compute(
    jmm: JointMuscleMap, nominal: NominalModel, cache_dir: str | os.PathLike[str]
) -> PointWeights | None:
    """Read what `point_weights` returns from a file, or compute it and write the file.

    A broken file is logged, and written again. A folder that cannot be written is logged.

    Args:
        jmm: the map that was trained on the nominal model.
        nominal: the nominal model.
        cache_dir: folder of trained maps.
    """
    if nominal.points is None:
        return None
    path = Path(cache_dir) / f"points-{_content_hash(jmm, nominal)}.npz"
    if path.exists():
        try:
            arrays = read_arrays(path, LARGEST)
            return tuple(
                _checked(arrays[f"group_{rank}"], group.W2.shape)
                for rank, group in enumerate(jmm.groups)
            )
        except (ArrayFileError, KeyError) as error:
            _log.warning("%s: %s. It is computed again.", path, error)
    found = point_weights(jmm, nominal)
    if found is not None:
        try:
            write_arrays(path, {f"group_{rank}": each for rank, each in enumerate(found)})
        except OSError as error:
            _log.warning("What points do to the lengths could not be kept in %s: %s.", path, error)
    return found


def _checked(weights: Floats, shape: tuple[int, ...]) -> Floats:
    """Weights of a group (muscles, H, P), if they are those of an output layer (muscles, H)."""
    if weights.ndim != 3 or weights.shape[:2] != shape or weights.dtype != np.float64:
        raise ArrayFileError("it has the weights of another map")
    if not np.isfinite(weights).all():
        raise ArrayFileError("it has a number that is not finite")
    return weights


def _content_hash(jmm: JointMuscleMap, nominal: NominalModel) -> str:
    """Hexadecimal digest of all that the weights depend on."""
    rng = np.random.default_rng(1)
    postures = rng.uniform(nominal.lower, nominal.upper, (PROBES, len(nominal.joints)))
    assert nominal.points is not None
    digest = hashlib.sha256(f"{fingerprint(jmm)} {POSTURES}".encode())
    for array in (nominal.lower, nominal.upper, nominal.points(postures)):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:24]
