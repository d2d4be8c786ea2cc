"""Likelihood of what was measured, for any wiring of the robot.

Responses are shares of the stroke; tensions are divided by K_stiff, so that lengths and tensions
have the same scale. Lengths are compared with what the nominal map predicts (`prediction`), and
tensions with the muscle law and the lengths measured at the same time,

    b_ki = t_k (a_ji / f_j - c_i [command i moves the muscle]),

where channel j reads the length of the muscle whose tension channel k reads, and c, f and t are the
factors of command, length and tension. This holds in any posture. Where that length is not known,
it is the predicted one.

Errors have Student's t distribution, because friction and a joint that leans on something give
responses that are far off. The standard deviation is that of the prediction, of friction and of the
noise. Those of prediction and friction are scaled by what the residuals show.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.commissioning.prediction import Prediction, Responses
from jmm_agent.commissioning.pull_record import PullRecord
from jmm_agent.commissioning.wiring import Wiring
from jmm_agent.types import Bools, Floats

FREEDOM = 4.0
"""Degrees of freedom of Student's t distribution of the errors."""
LEAST_STROKE = 0.2
"""Strokes that are shorter than this share of the longest tell nothing [1]."""
SOFTEST = 2.0
"""Largest ratio of the motors' stiffness to the tendons' [1]."""
SCALES = (0.25, 1.5)
"""Bounds of the scale of the prediction's spread [1]."""
FRICTION = (0.75, 4.0)
"""Bounds of the scale of friction [1], of tensions beside lengths."""
NORMAL = 1.4826
"""Standard deviation over median absolute deviation of a normal distribution."""
STILL = 0.1
"""Response of all other muscles, as a share of the stroke, below which a muscle at T_bias has not
been pulled [1]; beside the noise."""
NOISES = 4.0
"""The noise that counts, in standard deviations of a mean."""
MEANS = 1.5
"""Variance of a response over that of a mean: one mean, less half of two others [1]."""
AT_BIAS = (0.5, 1.35)
"""A muscle whose tension is within these shares of T_bias responds to nothing [1]."""


class Terms(NamedTuple):
    """Residuals of lengths and tensions, and their standard deviations; each (2, m, m) [1]."""

    residuals: Floats
    deviations: Floats


class Likelihood:
    """Compares wirings by what was measured.

    Args:
        record: of the pulls.
        prediction: of the nominal map.
        options: uncertainty.

    Attributes:
        record: as given.
        lengths: responses of the lengths as a share of the stroke (m, m) [1]; NaN where a muscle
            was not pulled enough.
        tensions: those of the tensions, divided by K_stiff (m, m) [1].
        apart: which responses are of other muscles than the one that is pulled (m, m).
        length_noise: standard deviation of the lengths by noise alone (m, m) [1].
        tension_noise: that of the tensions (m, m) [1].
        ratio: rho, of the motors' stiffness to the tendons' [1].
        scale: of the prediction's spread [1].
        friction: of the responses, as a share of the stroke [1].
    """

    def __init__(
        self, record: PullRecord, prediction: Prediction, options: CommissionOptions
    ) -> None:
        self.record, self._prediction, self._floor = record, prediction, options.floor
        strokes, motors, count = record.strokes, record.motors, len(record.strokes)
        enough = np.abs(strokes) > LEAST_STROKE * np.abs(strokes).max(initial=0.0)
        stroke = np.where(enough, strokes, np.nan)
        at_bias = (record.before > AT_BIAS[0] * motors.bias) & (
            record.before < AT_BIAS[1] * motors.bias
        )
        lengths = np.where(record.running[:, None], np.nan, record.lengths)
        moved = np.where(np.eye(count, dtype=bool), 0.0, np.abs(lengths))
        still = np.nanmax(moved, axis=0) < STILL * np.abs(strokes) + NOISES * record.length_noise
        stroke[np.diag(at_bias) & still] = np.nan
        self._at_bias = at_bias & ~np.eye(count, dtype=bool)
        self.lengths = lengths / -stroke
        self.tensions = np.where(at_bias, np.nan, record.tensions / (-stroke * motors.stiffness))
        size = np.abs(stroke) / np.sqrt(MEANS)
        self.length_noise = record.length_noise[:, None] / size
        self.tension_noise = record.tension_noise[:, None] / (size * motors.stiffness)
        self._responses: dict[bytes, Responses] = {}
        self.apart = ~np.eye(count, dtype=bool)
        self.scale, self.friction = 1.0, options.floor
        self.ratio = self._stiffness_ratio()

    def _stiffness_ratio(self) -> float:
        """rho: by how much lengths of other muscles respond less than predicted."""
        none = np.zeros(len(self.lengths), dtype=bool)
        hat = self.responses(none, none).mean
        products = np.where(self.apart, self.lengths * hat, np.nan)
        squares = np.where(np.isfinite(products), hat**2, np.nan)
        usable = np.nansum(squares, axis=0) > 0.0
        if not usable.any():
            return 0.0
        slopes = np.nansum(products, axis=0)[usable] / np.nansum(squares, axis=0)[usable]
        slope = float(np.median(slopes))
        return float(np.clip(1.0 / max(slope, 1e-3) - 1.0, 0.0, SOFTEST))

    def responses(self, absent: Bools, dead: Bools) -> Responses:
        """Predicted responses of the paths without some muscles (m,), and with dead motors (m,)."""
        key = absent.tobytes() + dead.tobytes()
        if key not in self._responses:
            at_bias = self._at_bias | dead[:, None]
            self._responses[key] = self._prediction.without(absent, at_bias)
        return self._responses[key]

    def predicted(self, wiring: Wiring) -> Responses:
        """Predicted responses of the lengths that encoders read, by muscle, and their spread.

        Args:
            wiring: only its absent muscles, dead motors and moment arms count.
        """
        hat, spread = self.responses(wiring.absent, wiring.dead)
        soft = 1.0 + self.ratio
        mean = (hat + self.ratio * np.diag(~wiring.dead)) / soft
        arms = np.where(self.apart, np.outer(wiring.arms, wiring.arms), 1.0)
        return Responses(mean * arms, spread / soft)

    def terms(self, wiring: Wiring) -> Terms:
        """Residuals in standard deviations, and these, of lengths and of tensions.

        Args:
            wiring: of the robot.
        """
        mean, spread = self.predicted(wiring)
        commands, drive = wiring.commands, wiring.command_factors
        where = np.ix_(wiring.lengths, commands)
        gain = np.outer(wiring.length_factors, drive)
        turns = wiring.absent[wiring.lengths][:, None] & (wiring.lengths[:, None] == commands)
        deviations = np.empty((2, *mean.shape))
        residuals = np.empty((2, *mean.shape))
        deviations[0] = self._deviation(
            gain, self.scale * spread[where], self.length_noise, max(self.friction, self._floor)
        )
        residuals[0] = np.where(turns, np.nan, self.lengths - gain * mean[where]) / deviations[0]
        seen, doubt = self._seen(wiring, mean, spread)
        own = wiring.tensions[:, None] == commands
        expected = wiring.tension_factors[:, None] * (seen - own * drive)
        expected[(wiring.absent | wiring.dead)[wiring.tensions]] = 0.0
        gain = np.repeat(wiring.tension_factors[:, None], len(mean), axis=1)
        deviations[1] = self._deviation(gain, doubt, self.tension_noise, self.friction)
        residuals[1] = (self.tensions - expected) / deviations[1]
        return Terms(residuals, deviations)

    def _seen(self, wiring: Wiring, mean: Floats, spread: Floats) -> tuple[Floats, Floats]:
        """Change of the length of the muscle of each tension (m, m) [1], and its deviation."""
        channel = np.argsort(wiring.lengths)[wiring.tensions]
        factor = wiring.length_factors[channel][:, None]
        known = (factor != 0.0) & np.isfinite(self.lengths[channel])
        safe = np.where(factor == 0.0, 1.0, factor)
        where = np.ix_(wiring.tensions, wiring.commands)
        drive = wiring.command_factors
        seen = np.where(known, self.lengths[channel] / safe, mean[where] * drive)
        noise = self.length_noise[channel] / np.abs(safe)
        return seen, np.where(known, noise, self.scale * spread[where] * np.abs(drive))

    def _deviation(self, gain: Floats, spread: Floats, noise: Floats, friction: float) -> Floats:
        """Standard deviation of responses with a factor (m, m) [1]."""
        dry = friction * np.maximum(np.abs(gain), 1.0)
        return np.asarray(np.sqrt((spread * gain) ** 2 + dry**2 + noise**2))

    def densities(self, wiring: Wiring) -> Floats:
        """Logarithm of the density of each response (2, m, m) [nat]; 0 for unknown ones.

        Args:
            wiring: of the robot.
        """
        residuals, deviations = self.terms(wiring)
        density = -0.5 * (FREEDOM + 1.0) * np.log1p(residuals**2 / FREEDOM) - np.log(deviations)
        return np.asarray(np.nan_to_num(density, nan=0.0))

    def of(self, wiring: Wiring) -> float:
        """Logarithm of the likelihood [nat].

        Args:
            wiring: of the robot.
        """
        return float(self.densities(wiring).sum())

    def rescale(self, wiring: Wiring) -> None:
        """Estimate friction and the scale of the spread from the residuals under a wiring."""
        self.scale, self.friction = 1.0, self._floor
        lengths, tensions = np.abs(self.terms(wiring).residuals)
        lengths = lengths[np.isfinite(lengths)]
        tensions = tensions[np.isfinite(tensions)]
        if tensions.size:
            friction = float(np.clip(NORMAL * np.median(tensions), *FRICTION))
            self.friction = friction * self._floor
        if lengths.size:
            self.scale = float(np.clip(NORMAL * np.median(lengths), *SCALES))
