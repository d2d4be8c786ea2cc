"""The joint-muscle mapping (JMM): lengths of all muscles and their Jacobian from joint angles.

One network with one hidden layer of sigmoids per group (Kawaharazuka et al. 2018, sec. II-A, II-B).
Inside it works in rad and mm as the paper does; every method speaks rad and m.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats, Ints
from mjcf_sandbox.files import whole_file

METRES = 1e-3  # metres per millimetre
QUADRATIC_STEP = float(np.deg2rad(10.0))  # [rad] sec. II-B
FORMAT = "jmm-1"
MAX_BYTES = 256 << 20
"""Largest map, unfolded [bytes]; the arm's has less than one MiB."""
LARGEST = 1e30
"""Largest number of a map, of `scale` the largest inverse: none of their products overflows."""
_ARRAYS = ("joint_index", "muscle_index", "centre", "scale", "W1", "b1", "W2", "b2")


class MappingError(AgentError):
    """A mapping was given arrays or postures that do not fit it."""


class CheckpointError(AgentError):
    """A file does not hold a mapping."""


@dataclass(frozen=True, eq=False)
class GroupMap:
    """The network of one group: l [mm] = W2 sigmoid(W1 (q - centre) / scale + b1) + b2.

    Attributes:
        name: the group's name.
        joint_index: its inputs among all joints, shape (n_in,).
        muscle_index: its outputs among all muscles, shape (k,).
        centre, scale: map the inputs' limits to [-1, 1] [rad], shape (n_in,).
        W1, b1: hidden layer, shapes (H, n_in) and (H,).
        W2, b2: output layer [mm], shapes (k, H) and (k,).

    All arrays are read-only float64.

    Raises:
        MappingError: shapes do not fit together, or a number is not finite, or beyond `LARGEST`.
    """

    name: str
    joint_index: Ints
    muscle_index: Ints
    centre: Floats
    scale: Floats
    W1: Floats
    b1: Floats
    W2: Floats
    b2: Floats

    def __post_init__(self) -> None:
        for field in _ARRAYS:
            kind = np.intp if field.endswith("index") else np.float64
            object.__setattr__(self, field, _frozen(getattr(self, field), kind))
        n, k, h = self.joint_index.size, self.muscle_index.size, self.b1.size
        shapes = ((n,), (k,), (n,), (n,), (h, n), (h,), (k, h), (k,))
        for field, shape in zip(_ARRAYS, shapes, strict=True):
            array = getattr(self, field)
            if array.shape != shape:
                raise MappingError(
                    f"Group {self.name!r}: {field} has shape {array.shape}, but {shape} fits."
                )
            if not (np.abs(array) <= LARGEST).all():
                raise MappingError(
                    f"Group {self.name!r}: {field} has a number that is not finite, or beyond "
                    f"{LARGEST:g}."
                )
        if not (self.scale >= 1.0 / LARGEST).all():
            raise MappingError(f"Group {self.name!r}: scale must be {1.0 / LARGEST:g} or more.")

    def hidden(self, q: Floats) -> Floats:
        """Activities (B, H) in (0, 1) of the hidden units at all joints' postures (B, n) [rad]."""
        return sigmoid((q[:, self.joint_index] - self.centre) @ self._inner.T + self.b1)

    def lengths(self, q: Floats) -> Floats:
        """Lengths (B, k) [m] of the group's muscles at postures (B, n) [rad] of all joints."""
        return METRES * (self.hidden(q) @ self.W2.T + self.b2)

    @cached_property
    def _inner(self) -> Floats:
        """Hidden weights (H, n_in) [1/rad]."""
        return self.W1 / self.scale

    def output_jacobian(self, hidden: Floats) -> Floats:
        """Jacobian (B, k, n_in) [m/rad] given the hidden activities (B, H)."""
        slope = METRES * hidden * (1.0 - hidden)
        if len(slope) == 1:
            return ((self.W2 * slope) @ self._inner)[None]
        pairs = self.W2.T[:, :, None] * self._inner[:, None, :]
        h, k, n = pairs.shape
        return (slope @ pairs.reshape(h, k * n)).reshape(-1, k, n)


@dataclass(frozen=True, eq=False)
class JointMuscleMap:
    """All groups' networks stacked: every muscle from every joint.

    Attributes:
        joints: names of the n joints.
        muscles: names of the m muscles; each is the output of exactly one group.
        groups: the networks.

    Immutable: learning makes a new map with `with_output_layers`.
    """

    joints: tuple[str, ...]
    muscles: tuple[str, ...]
    groups: tuple[GroupMap, ...]

    def __post_init__(self) -> None:
        muscles = [int(muscle) for group in self.groups for muscle in group.muscle_index]
        if sorted(muscles) != list(range(len(self.muscles))):
            raise MappingError("Map: each muscle must be the output of exactly one group.")
        for group in self.groups:
            if np.any((group.joint_index < 0) | (group.joint_index >= len(self.joints))):
                raise MappingError(f"Group {group.name!r}: a joint index is out of range.")

    def lengths(self, q: Floats) -> Floats:
        """Muscle lengths [m] relative to q = 0: (n,) -> (m,), or (B, n) -> (B, m)."""
        postures = self._postures(q)
        result = np.empty((len(postures), len(self.muscles)))
        for group in self.groups:
            result[:, group.muscle_index] = group.lengths(postures)
        return result if np.ndim(q) == 2 else result[0]

    def jacobian(self, q: Floats) -> Floats:
        """Analytic muscle Jacobian [m/rad]: (n,) -> (m, n), or (B, n) -> (B, m, n)."""
        return self.lengths_and_jacobian(q)[1]

    def lengths_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]:
        """Both at once, for one pass through the hidden layers; shapes as of the two alone."""
        postures = self._postures(q)
        lengths = np.empty((len(postures), len(self.muscles)))
        jacobian = np.zeros((len(postures), len(self.muscles), len(self.joints)))
        for group in self.groups:
            hidden = group.hidden(postures)
            lengths[:, group.muscle_index] = METRES * (hidden @ group.W2.T + group.b2)
            block = group.output_jacobian(hidden)
            jacobian[:, group.muscle_index[:, None], group.joint_index] = block
        return (lengths, jacobian) if np.ndim(q) == 2 else (lengths[0], jacobian[0])

    def jacobian_quadratic(self, q: Floats, step: float = QUADRATIC_STEP) -> Floats:
        """Muscle Jacobian [m/rad] smoothed by a quadratic through five points (sec. II-B).

        The points are q_j - 2 step .. q_j + 2 step [rad]. For such symmetric points the slope in
        the middle of the least-squares quadratic is sum(k l_k) / (10 step), k = -2 .. 2: the
        middle point has no weight, so four points per joint are evaluated, all in one call.
        Shapes: (n,) -> (m, n), or (B, n) -> (B, m, n).
        """
        if not (np.isfinite(step) and step > 0):
            raise MappingError(f"Quadratic Jacobian: step is {step} rad, but must be positive.")
        postures = self._postures(q)
        count = len(postures)
        offsets = np.array([-2.0, -1.0, 1.0, 2.0])
        result = np.zeros((count, len(self.muscles), len(self.joints)))
        for group in self.groups:
            inputs = group.joint_index
            moves = np.zeros((inputs.size, offsets.size, len(self.joints)))
            moves[np.arange(inputs.size), :, inputs] = step * offsets
            points = postures[:, None, None, :] + moves
            lengths = group.lengths(points.reshape(-1, len(self.joints)))
            lengths = lengths.reshape(count, inputs.size, offsets.size, -1)
            slopes = np.einsum("bnok,o->bkn", lengths, offsets / (10.0 * step))
            result[:, group.muscle_index[:, None], inputs] = slopes
        return result if np.ndim(q) == 2 else result[0]

    def with_output_layers(self, layers: Mapping[str, tuple[Floats, Floats]]) -> JointMuscleMap:
        """A new map in which the named groups have the output layers (W2 (k, H), b2 (k,)) [mm].

        Raises:
            MappingError: an unknown group, a wrong shape or a value that is not finite.
        """
        names = [group.name for group in self.groups]
        for name in layers:
            if name not in names:
                raise MappingError(f"Map: unknown group {name!r}; groups are {names}.")
        groups = tuple(
            replace(group, W2=layers[group.name][0], b2=layers[group.name][1])
            if group.name in layers
            else group
            for group in self.groups
        )
        return replace(self, groups=groups)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map to `path` (.npz without pickle), whole or not at all."""
        content: dict[str, np.ndarray] = {
            "format": np.array(FORMAT),
            "joints": np.array(self.joints),
            "muscles": np.array(self.muscles),
            "groups": np.array([group.name for group in self.groups]),
        }
        for rank, group in enumerate(self.groups):
            content |= {f"{rank}_{field}": getattr(group, field) for field in _ARRAYS}
        with whole_file(Path(path)) as beside, beside.open("wb") as file:
            np.savez(file, **content)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> JointMuscleMap:
        """Read a map that `save` wrote.

        Raises:
            CheckpointError: the file is missing, broken or something else.
        """
        if not os.path.isfile(path):  # also where its name is too long
            raise CheckpointError(f"Checkpoint {os.fspath(path)}: there is no such file.")
        try:
            _check_size(path)
            with np.load(path, allow_pickle=False) as content:
                if str(content["format"]) != FORMAT:
                    raise MappingError(f"its format is {content['format']}, not {FORMAT}")
                names = [str(name) for name in content["groups"]]
                groups = tuple(
                    GroupMap(name, *(content[f"{rank}_{field}"] for field in _ARRAYS))
                    for rank, name in enumerate(names)
                )
                joints = tuple(str(name) for name in content["joints"])
                muscles = tuple(str(name) for name in content["muscles"])
            return cls(joints, muscles, groups)
        except Exception as error:  # numpy raises whatever it stumbles over in a damaged file
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            raise CheckpointError(
                f"Checkpoint {os.fspath(path)}: not a joint-muscle map ({reason})."
            ) from error

    def _postures(self, q: Floats) -> Floats:
        postures = np.atleast_2d(np.asarray(q, dtype=np.float64))
        if postures.ndim != 2 or postures.shape[1] != len(self.joints) or np.ndim(q) == 0:
            raise MappingError(
                f"Map: postures have shape {np.shape(q)}, but ({len(self.joints)},) or "
                f"(B, {len(self.joints)}) is needed."
            )
        if not np.isfinite(postures).all():
            raise MappingError("Map: postures are not finite.")
        return postures


def sigmoid(z: NDArray[Any]) -> NDArray[Any]:
    """Logistic function of an array of floats of any precision, without overflow."""
    return 1.0 / (1.0 + np.exp(np.minimum(-z, 80.0)))


def _check_size(path: str | os.PathLike[str]) -> None:
    """Refuse an archive that unfolds into more than a map ever has."""
    with zipfile.ZipFile(path) as archive:
        size = sum(member.file_size for member in archive.infolist())
    if size > MAX_BYTES:
        raise MappingError(f"it unfolds into {size >> 20} MiB, and a map has {MAX_BYTES >> 20}")


def _frozen(array: Floats, kind: type) -> np.ndarray:
    """`array` itself when it is read-only already, else a read-only copy."""
    array = np.asarray(array, dtype=kind)
    if array.flags.writeable:
        array = array.copy()
        array.setflags(write=False)
    return array
