"""What the diagnosis must reach, each number with its 95 % interval."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.gap_bench.scores import (
    AMBIGUOUS,
    NOTHING,
    UNEXPLAINED,
    Trial,
    added_mass_error,
    entropy,
    exact_set,
    gain_ratio,
    parameter_error,
    right_first,
    right_location,
    right_or_equivalent,
    said,
    truth,
)
from experiments.harness.statistics import interval
from jmm_agent.types import Floats

Z = 1.959964
"""Of a 95 % interval."""
BINS = 10
LIMIT = 60.0
"""What 20 s of the elbow may take, on two cores [s]."""
ERRORS = {
    "mass": (3.0, "%"),
    "friction": (15.0, "%"),
    "stiffness": (30.0, "%"),
    "delay": (1.0, "samples"),
    "moved sites": (1.0, "mm"),
}
"""What the median error of a family of parameters may be."""


class Row(NamedTuple):
    """One number that the diagnosis is judged by.

    Attributes:
        name: what it says.
        cases: how many there were.
        value, low, high: with its 95 % interval; None where there is no case.
        unit: "%", "mm", ...
        most, least: what must be reached, None where nothing must.
    """

    name: str
    cases: int
    value: float | None
    low: float | None
    high: float | None
    unit: str
    most: float | None = None
    least: float | None = None

    @property
    def reached(self) -> bool | None:
        """None without a must or a case."""
        if self.value is None or (self.most is None and self.least is None):
            return None
        above = self.least is None or self.value >= self.least
        return above and (self.most is None or self.value <= self.most)

    def plain(self) -> dict[str, Any]:
        """The same for JSON."""
        return self._asdict() | {"reached": self.reached}


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    share, z = hits / count, Z
    middle = share + z * z / (2 * count)
    half = z * float(np.sqrt(share * (1 - share) / count + z * z / (4 * count * count)))
    scale = 1 + z * z / count
    low = (middle - half) / scale if hits else 0.0
    return low, min(1.0, (middle + half) / scale)


def share(name: str, right: Iterable[bool | None], **must: float) -> Row:
    """Share of cases in %; those without an answer do not count."""
    known = [bool(x) for x in right if x is not None]
    if not known:
        return Row(name, 0, None, None, None, "%", **must)
    low, high = wilson(sum(known), len(known))
    return Row(name, len(known), 100 * float(np.mean(known)), 100 * low, 100 * high, "%", **must)


def middle(name: str, values: Iterable[float | None], unit: str, **must: float) -> Row:
    """Median of some numbers with its bootstrap interval."""
    known = [float(x) for x in values if x is not None]
    if not known:
        return Row(name, 0, None, None, None, unit, **must)
    return Row(name, len(known), *interval(known), unit, **must)


def musts(trials: Sequence[Trial]) -> list[Row]:
    """Everything that must be reached, and what stands beside it."""
    single, pair, null, outside = (
        [t for t in trials if t["case"]["kind"] == kind]
        for kind in ("single", "pair", "null", "outside")
    )
    return [
        share("right cause first", map(right_first, single), least=90.0),
        share("right cause or a declared equivalent", map(right_or_equivalent, single), least=97.0),
        share("right muscle, joint or sensor", map(right_location, single), least=90.0),
        share("... or one declared to do the same", (right_location(t, True) for t in single)),
        share(
            "... of those with the right cause", map(right_location, filter(right_first, single))
        ),
        share("singles with a second cause named", (len(t["causes"]) > 1 for t in single)),
        share("false alarms on fault-free logs", (said(t) != NOTHING for t in null), most=5.0),
        share("outside called unexplained", (said(t) == UNEXPLAINED for t in outside), least=80.0),
        share("singles called unexplained", (said(t) == UNEXPLAINED for t in single), most=5.0),
        share("singles missed", (said(t) == NOTHING for t in single)),
        share("two causes, exact set", map(exact_set, pair), least=70.0),
        share("... with declared equivalents", (exact_set(t, True) for t in pair)),
        *_errors(single),
        _equivalents(trials),
        calibration_error(trials),
        middle("gain over that of the true model", map(_percent, single + pair), "%", least=80.0),
        *_after(single),
        share(
            f"diagnosed within {LIMIT:.0f} s by one process", (t["seconds"] < LIMIT for t in trials)
        ),
        middle("time of a diagnosis, one process", (t["seconds"] for t in trials), "s"),
        _worst("longest diagnosis", [t["seconds"] for t in trials], "s"),
    ]


def _percent(trial: Trial) -> float | None:
    ratio = gain_ratio(trial)
    return None if ratio is None else 100 * ratio


def _errors(single: Sequence[Trial]) -> list[Row]:
    found = [e for e in map(parameter_error, single) if e is not None]
    rows = [
        middle(f"error: {family}", (e for f, e in found if f == family), unit, most=most)
        for family, (most, unit) in ERRORS.items()
    ]
    return [*rows, middle("error: mass, over what was added", map(added_mass_error, single), "%")]


def _equivalents(trials: Sequence[Trial]) -> Row:
    counts = [float(len(c["equivalent"])) for t in trials for c in t["causes"]]
    return _mean("declared equivalents of a named cause, mean", counts, "", most=0.5)


def _mean(name: str, values: Sequence[float], unit: str, **must: float) -> Row:
    if not values:
        return Row(name, 0, None, None, None, unit, **must)
    numbers = np.array(values)
    drawn = np.random.default_rng(0).integers(len(numbers), size=(2000, len(numbers)))
    low, high = np.quantile(numbers[drawn].mean(axis=1), [0.025, 0.975])
    return Row(name, len(values), float(numbers.mean()), float(low), float(high), unit, **must)


def _worst(name: str, values: Sequence[float], unit: str) -> Row:
    return Row(name, len(values), max(values, default=None), None, None, unit)


def confidences(trials: Sequence[Trial]) -> tuple[Floats, Floats]:
    """Confidence of every named cause (k,), and whether it was there (k,)."""
    pairs = [
        (c["confidence"], c["cause"] in {e["cause"] for e in t["truth"]})
        for t in trials
        for c in t["causes"]
    ]
    return np.array([p for p, _ in pairs], float), np.array([r for _, r in pairs], float)


def bins(told: Floats) -> NDArray[np.int64]:
    """Which of `BINS` equal bins each confidence (k,) is in."""
    return np.minimum((told * BINS).astype(int), BINS - 1)


def expected_error(told: Floats, right: Floats) -> float:
    """Mean over named causes of |share right - mean confidence| of their bin."""
    where = bins(told)
    gaps = [abs(np.sum(right[where == b] - told[where == b])) for b in range(BINS)]
    return float(np.sum(gaps) / len(told))


def calibration_error(trials: Sequence[Trial]) -> Row:
    """Expected calibration error of all confidences."""
    name, (told, right) = "confidence, expected calibration error", confidences(trials)
    if not len(told):
        return Row(name, 0, None, None, None, "", most=0.10)
    drawn = np.random.default_rng(0).integers(len(told), size=(2000, len(told)))
    low, high = np.quantile([expected_error(told[i], right[i]) for i in drawn], [0.025, 0.975])
    return Row(name, len(told), expected_error(told, right), float(low), float(high), "", most=0.10)


def _after(single: Sequence[Trial]) -> list[Row]:
    """What the suggested experiment did to the doubt, where there was some."""
    done = [t for t in single if t["followup"] is not None]
    if not done:
        return []
    halved = []
    for t in done:
        before, after = entropy(t), entropy({**t["followup"], "truth": t["truth"]})
        halved.append(before is not None and after is not None and after <= 0.5 * before)
    then = (said(t["followup"]) == truth(t) for t in done)
    doubts = [t for t in single if (entropy(t) or 0.0) > AMBIGUOUS]
    advised = (t["followup"] is not None for t in doubts)
    return [
        share(f"an experiment is advised where entropy > {AMBIGUOUS:g} nats", advised),
        share("entropy halved by the suggested experiment", halved, least=80.0),
        share("right first before the suggested experiment", map(right_first, done)),
        share("... after it", then),
    ]
