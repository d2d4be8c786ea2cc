"""Marker observations as the arrays of a file, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jmm_agent.mapping.array_file import Arrays
from jmm_agent.types import Floats
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.pose_covariance import checked_covariance

OPTIONAL = ("covariance", "joint_angles", "tensions")
"""Arrays in which NaN stands for what was not measured."""


def arrays_of(observations: Sequence[MarkerObservation], joints: int, muscles: int) -> Arrays:
    """Arrays of K observations; "" and NaN stand for what some of them do not have.

    A length is NaN while its muscle is out of use.

    Args:
        observations: the observations.
        joints: number of joints, n.
        muscles: number of muscles, m.
    """
    frames = [found.frames or ("", None) for found in observations]
    return {
        "pose": np.array([found.pose for found in observations]).reshape(-1, 4, 4),
        "lengths": np.array([found.lengths for found in observations]).reshape(-1, muscles),
        "guess": np.array([found.guess for found in observations]).reshape(-1, joints),
        "frames": np.array([(of, within or "") for of, within in frames], "U").reshape(-1, 2),
        "covariance": np.array(
            [_or_nan(found.covariance, (6, 6)) for found in observations]
        ).reshape(-1, 6, 6),
        "joint_angles": np.array(
            [_or_nan(found.joint_angles, (joints,)) for found in observations]
        ).reshape(-1, joints),
        "tensions": np.array(
            [_or_nan(found.tensions, (muscles,)) for found in observations]
        ).reshape(-1, muscles),
    }


def _or_nan(array: Floats | None, shape: tuple[int, ...]) -> Floats:
    return np.full(shape, np.nan) if array is None else array


def observations_of(arrays: Arrays) -> list[MarkerObservation]:
    """The observations of which `arrays_of` made arrays.

    Args:
        arrays: with those of the observations, whose shapes were checked.

    Raises:
        AgentError: a covariance is not valid.
    """
    found = []
    for row in zip(
        *(arrays[name] for name in ("pose", "lengths", "guess", *OPTIONAL)),
        arrays["frames"].tolist(),
        strict=True,
    ):
        pose, lengths, guess, covariance, angles, tensions, (of, within) = row
        found.append(
            MarkerObservation(
                pose.astype(float),
                lengths.astype(float),
                guess.astype(float),
                (of, within or None) if of else None,
                None if np.isnan(covariance).all() else checked_covariance(covariance),
                None if np.isnan(angles).all() else angles.astype(float),
                None if np.isnan(tensions).all() else tensions.astype(float),
            )
        )
    return found
