"""Scores of a detector's answers: what is counted as found, covered, sure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import chi2

from experiments.hand_detector.frames import HIDDEN, NONE, SEEN

Record = Mapping[str, Any]
LEVEL = 0.95
LIMIT = float(chi2.ppf(LEVEL, 6))
"""Square of the error's distance at the border of the region that holds 95 % [1]."""
ELSEWHERE_MM = 100.0
"""A claim farther than this from the hand is of something else: about half the hand's length."""
SURE_MM, SURE_DEG = 25.0, 6.0
"""Largest standard deviation of a claim that is sure."""
GROSS = float(chi2.ppf(0.999, 6))
"""Square of the distance of an error that a sure claim denies [1]."""
WITHOUT, EXPECTED = "without", "expected"
"""Answers without and with a pose that the joints expect."""
MOVED = "second hand, own one moves"
"""What records of scenes with two hands are of."""
OWN = "own"
"""Choice by the movements, in a frame of such a scene."""


def frames_of(records: Sequence[Record], *kinds: str) -> list[Record]:
    """Records of usual frames of some kinds."""
    return [r for r in records if r["of"] == "frame" and r["kind"] in kinds]


def seen(records: Sequence[Record]) -> list[Record]:
    """Frames with at least half of the hand visible."""
    return frames_of(records, SEEN)


def with_hand(records: Sequence[Record]) -> list[Record]:
    """Frames with a visible part of the hand."""
    return frames_of(records, SEEN, HIDDEN)


def empty(records: Sequence[Record]) -> list[Record]:
    """Frames without any hand."""
    return frames_of(records, NONE)


def claims(record: Record, key: str = WITHOUT) -> bool:
    """Whether a pose is claimed."""
    return bool(record[key]["claims"])


def found(record: Record, key: str = WITHOUT) -> bool:
    """Whether a pose is claimed, and of the hand."""
    return claims(record, key) and bool(record[key]["position_mm"] <= ELSEWHERE_MM)


def elsewhere(record: Record, key: str = WITHOUT) -> bool | None:
    """Whether a claimed pose is of something else; None without a claim."""
    return not found(record, key) if claims(record, key) else None


def error(record: Record, name: str, key: str = WITHOUT) -> float | None:
    """An error of a claimed pose, ``position_mm`` or ``rotation_deg``; None without a claim."""
    return float(record[key][name]) if claims(record, key) else None


def covered(record: Record, key: str = WITHOUT) -> bool | None:
    """Whether the error is in the claimed region; None without a claim."""
    if not claims(record, key):
        return None
    distance2 = record[key]["distance2"]
    return distance2 is not None and bool(distance2 <= LIMIT)


def sure(record: Record, key: str = WITHOUT) -> bool:
    """Whether a pose is claimed that is precise by its own covariance."""
    each = record[key]
    if not each["claims"] or each["position_std_mm"] is None:
        return bool(each["claims"])  # a claim without a covariance is believed as it is
    return bool(each["position_std_mm"] <= SURE_MM and each["rotation_std_deg"] <= SURE_DEG)


def sure_and_wrong(record: Record, key: str = WITHOUT) -> bool:
    """Whether a claim is sure, and the truth far outside of its region."""
    distance2 = record[key].get("distance2")
    return sure(record, key) and (distance2 is None or bool(distance2 > GROSS))


def own_chosen(record: Record, key: str = WITHOUT) -> bool:
    """Whether the own one of two hands is claimed, and not the other."""
    if not found(record, key):
        return False
    return bool(record[key]["position_mm"] < record[f"{key}_other"]["position_mm"])


def other_chosen(record: Record, key: str = WITHOUT) -> bool:
    """Whether a pose is claimed that is not of the own hand."""
    return claims(record, key) and not own_chosen(record, key)
