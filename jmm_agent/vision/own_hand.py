"""Which of the hands in a frame is the own one: the one that moves as the joints do.

Another robot's hand may look the same, and the expected pose of the own hand may be far off, so
that neither shape nor nearness shows which one is which. The movement does: whatever the constant
error of the expected pose, it moves from one frame to another much as the own hand does. Hands are
followed over frames, and each movement of a hand is compared with three explanations:

- own: it moved in the camera as the expected pose did, but for a share of the movement, which is
  small for a robot that has learned, and unknown;
- still: it stayed where it was in the world, while the camera may have turned with the head, or
  where it was in the camera;
- otherwise: it moved by itself, by any amount.

The evidence of a hand is the sum of log p(movement | own) - log p(movement | still or otherwise),
of which the likelier one is taken. A share `MISTAKES` of movements is measured wrong, so that no
single movement decides. A movement counts only if the joints moved enough to distinguish the own
hand from a still one; it is measured from the last one that counted, or from a surer pose since.

Before the own hand is known, a hand is believed if no other one may be the own hand, and if its
movements do not speak against it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from jmm_agent.types import Floats
from jmm_agent.vision.hand_detection import HandDetection, HandSkip

LEAST_ERROR = (0.01, np.radians(3.0))
"""Standard deviations of any predicted movement along and about each axis [m, rad]."""
SHARES = 0.15, 0.3
"""Standard deviations of a predicted movement, as shares of it, both as likely [1]: joints that are
10 or 17 deg off turn its direction by as much. Before a robot has learned, each joint of it is
off by about 12 deg, by errors that change with the posture."""
LEVER = 0.06
"""By how much the expected hand may be displaced along each axis [m]; a turn of it by an angle adds
the standard deviation `LEVER` times this angle."""
OTHERWISE = (0.3, np.radians(60.0))
"""Standard deviations of the movement of a hand that moves by itself [m, rad]."""
DISTINCT = 2.0
"""Standard deviations by which the predictions for the own hand and for a still one must differ, if
a movement is to count [1]."""
MISTAKES = 0.05
"""Share of movements that are measured wrong [1]; the evidence of one is at most log(19) = 2.9."""
KNOWN = float(np.log(1000.0))
"""Evidence from which on a hand is the own one, and below whose negative it is not: three movements
of a hand that is seen well."""
MOST = 1.5 * KNOWN
"""Largest evidence for or against a hand: what is believed can be unlearned in some movements."""
TRACKS = 6
"""Number of hands that are followed; the one that was not seen for the longest is forgotten."""
NEW = -3.0
"""Log-likelihood of a hand that was not seen before, in the units of `Explained` [1]: anywhere in
the view, in one of twenty frames."""


class ExpectedPoses(NamedTuple):
    """What the joints predict for a frame.

    Attributes:
        hand: pose of the own hand in the camera (4, 4), translation in metres.
        camera: pose of the camera in the world (4, 4).
    """

    hand: Floats
    camera: Floats

    def shifted(self, before: ExpectedPoses, after: ExpectedPoses) -> ExpectedPoses:
        """The same by another map, which predicts ``after`` where the old one predicts
        ``before``."""
        pairs = zip(self, before, after, strict=True)
        return ExpectedPoses(*(moved(pose, one, other) for pose, one, other in pairs))


class Sample(NamedTuple):
    """A hand in a frame, with what the joints predicted for that frame."""

    hand: HandDetection
    expected: ExpectedPoses

    def is_surer_than(self, other: Sample) -> bool:
        """Whether the pose is known better, in all."""
        sizes = [np.linalg.slogdet(each.hand.covariance)[1] for each in (self, other)]
        return bool(sizes[0] < sizes[1])


@dataclass
class Track:
    """A hand that is followed.

    Attributes:
        last: where it was when a movement of it counted last, or a surer pose since; movements are
            measured from there.
        evidence: that it is the own one, a log-likelihood ratio.
        frame: number of the frame in which it was seen last.
    """

    last: Sample
    evidence: float
    frame: int

    @property
    def is_own(self) -> bool:
        """Whether it is known to be the own hand."""
        return self.evidence >= KNOWN

    @property
    def may_be_own(self) -> bool:
        """Whether it is not known to be another hand."""
        return self.evidence > -KNOWN


class Explained(NamedTuple):
    """Log-likelihoods of a hand's movement, up to a common constant.

    Attributes:
        own: if it moved as the joints did.
        still: if it stayed where it was, in the world or in the camera.
        otherwise: if it moved by itself.
        distinct: whether the movement could distinguish the own hand from a still one.
    """

    own: float
    still: float
    otherwise: float
    distinct: bool

    def likelihood(self, evidence: float) -> float:
        """Log-likelihood of the movement of a hand, by the evidence that it is the own one: it is
        another one that is still or jumps."""
        own, other = -np.logaddexp(0.0, -evidence), -np.logaddexp(0.0, evidence)
        return float(max(self.own + own, max(self.still, self.otherwise) + other))

    @property
    def evidence(self) -> float:
        """That the hand is the own one, some movements being measured wrong."""
        own, other = self.own, max(self.still, self.otherwise)
        right, wrong = np.log(1.0 - MISTAKES), np.log(MISTAKES)
        return float(
            np.logaddexp(right + own, wrong + other) - np.logaddexp(right + other, wrong + own)
        )


class OwnHand:
    """Follows the hands in frames, and finds which one is the own one (module docstring).

    What it remembers is about one episode: other hands may be elsewhere in the next one.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all hands, as before a new episode."""
        self._tracks: list[Track] = []
        self._frame = 0

    @property
    def known(self) -> bool:
        """Whether one of the hands is known to be the own one."""
        return any(track.is_own for track in self._tracks)

    def choose(
        self, hands: Sequence[HandDetection], expected: ExpectedPoses
    ) -> HandDetection | HandSkip:
        """The own one of the hands in a frame, or why none is chosen.

        Args:
            hands: that are seen in the frame, at least one.
            expected: what the joints predict for the time of the frame.

        Returns:
            The own hand; before it is known, the only one that may be it (module docstring).
        """
        self._frame += 1
        seen = [Sample(hand, expected) for hand in hands]
        tracks = self._follow(seen)
        own = [k for k, track in enumerate(tracks) if track.is_own]
        if len(own) == 1:
            return hands[own[0]]
        if own:
            return HandSkip.TWICE
        if self.known or not any(track.may_be_own for track in tracks):
            return HandSkip.ANOTHER
        if sum(track.may_be_own for track in self._tracks) > 1:
            return HandSkip.TWICE
        [only] = [k for k, track in enumerate(tracks) if track.may_be_own]
        return hands[only] if tracks[only].evidence >= 0.0 else HandSkip.ANOTHER

    def map_changed(self, before: ExpectedPoses, after: ExpectedPoses) -> None:
        """Take note of another map of the joints, with which all was expected elsewhere.

        Args:
            before: what the old map predicts for now.
            after: what the new map predicts for now.
        """
        for track in self._tracks:
            hand, expected = track.last
            track.last = Sample(hand, expected.shifted(before, after))

    def _follow(self, seen: Sequence[Sample]) -> list[Track]:
        """The track of each hand in a frame, which is continued or begun."""
        known = self._tracks
        table = [[explain(track.last, sample) for track in known] for sample in seen]
        fits = np.full((len(seen), len(known) + len(seen)), NEW)
        for row, explained in enumerate(table):
            pairs = zip(explained, known, strict=True)
            fits[row, : len(known)] = [one.likelihood(track.evidence) for one, track in pairs]
        found: list[Track] = []
        for row, column in zip(*linear_sum_assignment(fits, maximize=True), strict=True):
            if column < len(known):
                self._continue(known[column], seen[row], table[row][column])
                found.append(known[column])
            else:
                found.append(Track(seen[row], 0.0, self._frame))
        begun = [track for track in found if not any(track is other for other in known)]
        newest = sorted([*known, *begun], key=lambda track: -track.frame)
        self._tracks = newest[:TRACKS]
        return found

    def _continue(self, track: Track, sample: Sample, explained: Explained) -> None:
        track.frame = self._frame
        if explained.distinct:
            track.evidence = float(np.clip(track.evidence + explained.evidence, -MOST, MOST))
        if explained.distinct or sample.is_surer_than(track.last):
            track.last = sample


def explain(before: Sample, now: Sample) -> Explained:
    """Log-likelihoods of the movement of a hand from one frame to another."""
    start, end = before.hand.pose_hand_in_camera, now.hand.pose_hand_in_camera
    camera = np.linalg.inv(now.expected.camera) @ before.expected.camera
    stays = camera @ start, start  # in the world, and in the camera
    own = moved(start, before.expected.hand, now.expected.hand)
    went = [difference(own, stay) for stay in stays]
    measured = before.hand.covariance + now.hand.covariance
    turned, size = _sizes(difference(stays[0], start)), _sizes(went[0])

    def of_still(share: float) -> Floats:
        return measured + _diagonal(np.square(LEAST_ERROR) + np.square(share * turned))

    def of_own(share: float) -> Floats:
        errors = np.square(share * size) + np.square([LEVER * size[1], 0.0])
        return of_still(share) + _diagonal(errors)

    widest = of_own(max(SHARES))
    return Explained(
        _mean(_log_normal(difference(end, own), of_own(share)) for share in SHARES),
        max(
            _mean(_log_normal(difference(end, stay), of_still(share)) for share in SHARES)
            for stay in stays
        ),
        _log_normal(
            difference(end, stays[0]), of_still(max(SHARES)) + _diagonal(np.square(OTHERWISE))
        ),
        all(bool(each @ np.linalg.solve(widest, each) >= DISTINCT**2) for each in went),
    )


def _mean(logarithms: Iterable[float]) -> float:
    """Logarithm of the mean of densities."""
    each = list(logarithms)
    return float(np.logaddexp.reduce(each) - np.log(len(each)))


def moved(pose: Floats, before: Floats, after: Floats) -> Floats:
    """A pose (4, 4), moved and turned in the axes of the reference as another one was."""
    result = pose.copy()
    result[:3, :3] = after[:3, :3] @ before[:3, :3].T @ pose[:3, :3]
    result[:3, 3] += after[:3, 3] - before[:3, 3]
    return result


def difference(pose: Floats, other: Floats) -> Floats:
    """Offset [m] and rotation vector [rad] (6,) from another pose, see `pose_covariance`."""
    turn = cv2.Rodrigues(pose[:3, :3] @ other[:3, :3].T)[0].ravel()
    return np.concatenate([pose[:3, 3] - other[:3, 3], turn])


def _sizes(movement: Floats) -> Floats:
    """Distance [m] and angle [rad] of a movement (6,)."""
    return np.linalg.norm(movement.reshape(2, 3), axis=1)


def _diagonal(variances: Floats) -> Floats:
    """Covariance (6, 6) of the variances along and about each axis [m^2, rad^2]."""
    return np.diag(np.repeat(variances, 3))


def _log_normal(error: Floats, covariance: Floats) -> float:
    """Logarithm of a normal density at an error (6,), without the constant."""
    size = np.linalg.slogdet(covariance)[1]
    return float(-0.5 * (error @ np.linalg.solve(covariance, error) + size))
