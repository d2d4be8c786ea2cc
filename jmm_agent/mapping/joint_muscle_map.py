"""The joint-muscle mapping (JMM): lengths of all muscles and their Jacobian from joint angles.

Each group of muscles has a network with one hidden layer of sigmoids (Kawaharazuka et al. 2018,
sec. II-A, II-B). The layers are in rad and mm as in the paper; all methods use rad and m.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.mapping.array_file import ArrayFileError, read_arrays, write_arrays
from jmm_agent.mapping.group_map import ARRAYS, METRES, GroupMap, Layers, MappingError
from jmm_agent.mapping.group_stack import GroupStack
from jmm_agent.mapping.tendon_stretch import FIELDS, TendonStretch
from jmm_agent.types import Floats

QUADRATIC_STEP = float(np.deg2rad(10.0))
"""Distance of the points of the quadratic Jacobian (sec. II-B) [rad]."""
FORMAT, WITH_TENDONS = "jmm-1", "jmm-2"
"""Formats of the files of maps whose tendons do not stretch, and do."""
MAX_BYTES = 64 << 20
"""Largest map file, unfolded [bytes]; that of the arm has less than one MiB."""


class CheckpointError(AgentError):
    """A file that does not hold a map, or not what an agent has learned."""


@dataclass(frozen=True, eq=False)
class JointMuscleMap:
    """Map from joint angles to muscle lengths: the networks of all groups.

    It is immutable; learning makes a new map by `with_layers` or `with_output_layers`.

    Attributes:
        joints: names of the n joints.
        muscles: names of the m muscles; each is the output of exactly one group.
        groups: the networks.
        tendons: how tendons stretch by tension; None: not at all, as in the paper.

    Raises:
        MappingError: a muscle is not the output of exactly one group, an index is out of range, or
            there are tendons of another number of muscles.
    """

    joints: tuple[str, ...]
    muscles: tuple[str, ...]
    groups: tuple[GroupMap, ...]
    tendons: TendonStretch | None = None

    def __post_init__(self) -> None:
        muscles = [int(muscle) for group in self.groups for muscle in group.muscle_index]
        if sorted(muscles) != list(range(len(self.muscles))):
            raise MappingError("Map: each muscle must be the output of exactly one group.")
        for group in self.groups:
            if np.any((group.joint_index < 0) | (group.joint_index >= len(self.joints))):
                raise MappingError(f"Group {group.name!r}: a joint index is out of range.")
        if self.tendons is not None and len(self.tendons.compliance) != len(self.muscles):
            raise MappingError(
                f"Map: there are tendons of {len(self.tendons.compliance)} muscles, but "
                f"{len(self.muscles)} muscles."
            )

    def lengths(self, q: Floats, tensions: Floats | None = None) -> Floats:
        """Muscle lengths relative to q = 0, as the encoders measure them.

        Args:
            q: joint angles (n,) or (B, n) [rad].
            tensions: of the muscles (m,) or (B, m) [N]; None: those of reference, see
                `TendonStretch`. Without tendons that stretch they have no effect.

        Returns:
            Lengths (m,) or (B, m) [m].

        Raises:
            MappingError: a wrong shape, or a number that is not finite.
        """
        if tensions is not None:
            return np.asarray(self.lengths(q) - self.stretch(tensions))
        postures = self._postures(q)
        if np.ndim(q) == 1:
            return self._stack.lengths(self._stack.hidden(postures[0]))
        result = np.empty((len(postures), len(self.muscles)))
        for group in self.groups:
            result[:, group.muscle_index] = group.lengths(postures)
        return result

    def stretch(self, tensions: Floats) -> Floats:
        """By how much tensions shorten the measured lengths (m,) or (B, m) [m].

        Args:
            tensions: of the muscles (m,) or (B, m) [N].

        Raises:
            MappingError: a wrong shape, or a tension that is not finite.
        """
        checked = self._tensions(tensions)
        return np.zeros(checked.shape) if self.tendons is None else self.tendons.stretch(checked)

    def tension_jacobian(self, tensions: Floats) -> Floats:
        """Diagonal of dl/dT (m,) or (B, m) [m/N]: 0, or the negative compliance of each tendon.

        Args:
            tensions: of the muscles (m,) or (B, m) [N].

        Raises:
            MappingError: a wrong shape, or a tension that is not finite.
        """
        checked = self._tensions(tensions)
        return np.zeros(checked.shape) if self.tendons is None else -self.tendons.slope(checked)

    def jacobian(self, q: Floats) -> Floats:
        """Analytic muscle Jacobian G = dl/dq (sec. II-B).

        Args:
            q: joint angles (n,) or (B, n) [rad].

        Returns:
            Jacobian (m, n) or (B, m, n) [m/rad].

        Raises:
            MappingError: a wrong shape, or an angle that is not finite.
        """
        return self.lengths_and_jacobian(q)[1]

    def lengths_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]:
        """Muscle lengths and Jacobian, by one pass through the hidden layers.

        Args:
            q: joint angles (n,) or (B, n) [rad].

        Returns:
            Lengths (m,) or (B, m) [m], and Jacobian (m, n) or (B, m, n) [m/rad].

        Raises:
            MappingError: a wrong shape, or an angle that is not finite.
        """
        postures = self._postures(q)
        if np.ndim(q) == 1:
            hidden = self._stack.hidden(postures[0])
            return self._stack.lengths(hidden), self._stack.jacobian(hidden)
        lengths = np.empty((len(postures), len(self.muscles)))
        jacobian = np.zeros((len(postures), len(self.muscles), len(self.joints)))
        for group in self.groups:
            hidden = group.hidden(postures)
            lengths[:, group.muscle_index] = METRES * (hidden @ group.W2.T + group.b2)
            block = group.output_jacobian(hidden)
            jacobian[:, group.muscle_index[:, None], group.joint_index] = block
        return lengths, jacobian

    def torque_slope(self, q: Floats, tensions: Floats) -> Floats:
        """How the torques G(q)' T of given tensions change with the posture.

        Args:
            q: joint angles (B, n) [rad].
            tensions: T (B, m) [N].

        Returns:
            Derivatives of the torques (B, n, n) [N m/rad], symmetric.

        Raises:
            MappingError: a wrong shape, or an angle that is not finite.
        """
        postures = self._postures(q)
        result = np.zeros((len(postures), len(self.joints), len(self.joints)))
        for group in self.groups:
            slope = group.torque_slope(group.hidden(postures), tensions[:, group.muscle_index])
            result[:, group.joint_index[:, None], group.joint_index] += slope
        return result

    def jacobian_quadratic(self, q: Floats, step: float = QUADRATIC_STEP) -> Floats:
        """Muscle Jacobian, smoothed by a quadratic through five points (sec. II-B).

        The points are q_j - 2 step .. q_j + 2 step. For such symmetric points the slope of the
        least-squares quadratic at the middle is sum(k l_k) / (10 step), k = -2 .. 2. The middle
        point has no weight, so four points per joint are evaluated.

        Args:
            q: joint angles (n,) or (B, n) [rad].
            step: distance of the points [rad].

        Returns:
            Jacobian (m, n) or (B, m, n) [m/rad].

        Raises:
            MappingError: a wrong shape, an angle that is not finite, or a step that is not
                positive.
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
        """A new map with other output layers.

        Args:
            layers: W2 (k, H) and b2 (k,) [mm] by the name of the group; others stay.

        Raises:
            MappingError: an unknown group, a wrong shape or a number that is not finite.
        """
        self._check_names(layers)
        return self.with_layers(
            {
                group.name: group.layers._replace(W2=W2, b2=b2)
                for group in self.groups
                if group.name in layers
                for W2, b2 in [layers[group.name]]
            }
        )

    def with_layers(self, layers: Mapping[str, Layers]) -> JointMuscleMap:
        """A new map with other layers.

        Args:
            layers: of each group by its name; others stay.

        Raises:
            MappingError: an unknown group, a wrong shape or a number that is not finite.
        """
        self._check_names(layers)
        groups = tuple(
            replace(group, **layers[group.name]._asdict()) if group.name in layers else group
            for group in self.groups
        )
        return replace(self, groups=groups)

    def without(self, muscles: Sequence[str]) -> JointMuscleMap:
        """A map of the other muscles.

        Args:
            muscles: names of the muscles that are left out.

        Raises:
            MappingError: a name is unknown, or none is left.
        """
        for name in muscles:
            if name not in self.muscles:
                raise MappingError(f"Map: unknown muscle {name!r}; muscles are {self.muscles}.")
        kept = [index for index, name in enumerate(self.muscles) if name not in muscles]
        if not kept:
            raise MappingError("Map: no muscle is left.")
        number = {index: rank for rank, index in enumerate(kept)}
        groups = []
        for group in self.groups:
            rows = [row for row, index in enumerate(group.muscle_index) if int(index) in number]
            index = np.array([number[int(each)] for each in group.muscle_index[rows]], dtype=int)
            if rows:
                w2, b2 = group.W2[rows], group.b2[rows]
                groups.append(replace(group, muscle_index=index, W2=w2, b2=b2))
        names = tuple(self.muscles[index] for index in kept)
        tendons = None if self.tendons is None else self.tendons.of(kept)
        return JointMuscleMap(self.joints, names, tuple(groups), tendons)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map to a file (.npz without pickle), atomically.

        Args:
            path: of the file.
        """
        content: dict[str, np.ndarray] = {
            "format": np.array(FORMAT if self.tendons is None else WITH_TENDONS),
            "joints": np.array(self.joints),
            "muscles": np.array(self.muscles),
            "groups": np.array([group.name for group in self.groups]),
        }
        for rank, group in enumerate(self.groups):
            content |= {f"{rank}_{field}": getattr(group, field) for field in ARRAYS}
        if self.tendons is not None:
            content |= {f"tendons_{field}": getattr(self.tendons, field) for field in FIELDS}
        write_arrays(path, content)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> JointMuscleMap:
        """Read a map that `save` wrote.

        Args:
            path: of the file.

        Raises:
            CheckpointError: the file is missing, broken or does not hold a map.
        """
        try:
            content = read_arrays(path, MAX_BYTES)
        except ArrayFileError as error:
            raise CheckpointError(f"Checkpoint {os.fspath(path)}: {error}.") from error
        try:
            form = str(content.get("format"))
            if form not in (FORMAT, WITH_TENDONS):
                raise MappingError(f"its format is {form}, not {FORMAT} or {WITH_TENDONS}")
            groups = tuple(
                GroupMap(str(name), *(content[f"{rank}_{field}"] for field in ARRAYS))
                for rank, name in enumerate(content["groups"])
            )
            joints = tuple(str(name) for name in content["joints"])
            muscles = tuple(str(name) for name in content["muscles"])
            if form == FORMAT:
                return cls(joints, muscles, groups)
            tendons = TendonStretch(*(content[f"tendons_{field}"] for field in FIELDS))
            return cls(joints, muscles, groups, tendons)
        except Exception as error:  # NumPy raises errors of many types for arrays that do not fit
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            raise CheckpointError(
                f"Checkpoint {os.fspath(path)}: not a joint-muscle map ({reason})."
            ) from error

    def __reduce__(self) -> tuple[type[JointMuscleMap], tuple[Any, ...]]:
        """Copies and pickles are without what is computed from the groups."""
        return JointMuscleMap, (self.joints, self.muscles, self.groups, self.tendons)

    @cached_property
    def _stack(self) -> GroupStack:
        return GroupStack(self.groups, len(self.muscles), len(self.joints))

    def _check_names(self, layers: Iterable[str]) -> None:
        names = [group.name for group in self.groups]
        for name in layers:
            if name not in names:
                raise MappingError(f"Map: unknown group {name!r}; groups are {names}.")

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

    def _tensions(self, tensions: Floats) -> Floats:
        checked = np.asarray(tensions, dtype=np.float64)
        if checked.ndim not in (1, 2) or checked.shape[-1] != len(self.muscles):
            raise MappingError(
                f"Map: tensions have shape {checked.shape}, but ({len(self.muscles)},) or "
                f"(B, {len(self.muscles)}) is needed."
            )
        if not np.isfinite(checked).all():
            raise MappingError("Map: tensions are not finite.")
        return checked


def fingerprint(jmm: JointMuscleMap) -> str:
    """Hexadecimal digest of a map: two maps have the same one if they are the same to the bit.

    Args:
        jmm: the map.
    """
    digest = hashlib.sha256(repr((jmm.joints, jmm.muscles)).encode())
    for group in jmm.groups:
        digest.update(group.name.encode())
        for name in ARRAYS:
            array = getattr(group, name)
            digest.update(f"{name} {array.shape} {array.dtype}".encode() + array.tobytes())
    return digest.hexdigest()
