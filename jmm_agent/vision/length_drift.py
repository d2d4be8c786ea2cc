"""Lengths that drift: encoders slip, wires creep or warm up, all the time.

The length of each muscle is then off by an error d(t) that grows with time, which no number of
looks averages out, and which is no step. Its speed is believed to be a Gaussian process of standard
deviation v, the same for all muscles, that changes in about `CHANGES`, tau below. What a length has
drifted since the times a and b before now is then the process integrated twice,

    E[d_a d_b] = v^2 tau^2 (2 min(a, b) / tau - 1 + exp(-a / tau) + exp(-b / tau)
                            - exp(-|a - b| / tau)),

which is v^2 a b for times far below tau, as of a constant speed, and 2 v^2 tau min(a, b), as of a
random walk, for times far above it. The fit of all rests adds it to the covariance C of the
lengths' errors; `jmm_agent.updaters.model_choice` chooses v, of some `SPEEDS`. The update rule
of Kawaharazuka et al. 2018 follows slow changes by forgetting (sec. I); a rule that remembers needs
this module.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.types import Floats

CHANGES = 300.0
"""Time in which the speed of a drift changes [s]."""
SPEEDS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Standard deviations of the drift's speed that are compared, in noises of a length a minute."""
AT_ONCE = 2
"""Number of next lower and next higher speeds that are compared after an observation."""
PAUSE = 600.0
"""Longest time between two looks that is counted; in a longer one the robot was off [s]."""


class LengthDrift(NamedTuple):
    """Drift of all lengths, and how long ago each remembered observation was.

    Attributes:
        speed: standard deviation of the speed of each length [m/s]; 0: none is believed.
        ages: of the K observations (K,) [s].
        time: of the newest one [s]; NaN before the first one of an episode.
    """

    speed: float = 0.0
    ages: Floats = np.zeros(0)
    time: float = np.nan

    def at(self, time: float) -> LengthDrift:
        """The same at a later time [s]; NaN: unknown, and none has passed."""
        if np.isnan(time):
            return self
        passed = 0.0 if np.isnan(self.time) else min(max(time - self.time, 0.0), PAUSE)
        return self._replace(ages=self.ages + passed, time=time)

    def observing(self, count: int) -> LengthDrift:
        """With a new observation, the last of so many that are then remembered."""
        ages = np.append(self.ages, 0.0)[-count:]
        return self._replace(ages=np.pad(ages, (count - len(ages), 0), mode="edge"))

    @property
    def covariance(self) -> Floats | None:
        """Of what a length has drifted since each observation (K, K) [m^2]; None: it did not."""
        if self.speed == 0.0:
            return None
        ages = self.ages / CHANGES
        gone = np.expm1(-ages)
        apart = np.expm1(-np.abs(np.subtract.outer(ages, ages)))
        shared = 2.0 * np.minimum.outer(ages, ages) + np.add.outer(gone, gone) - apart
        return np.asarray((self.speed * CHANGES) ** 2 * shared)


def near_speeds(present: float, noise: float) -> list[float]:
    """Speeds of the drift that are compared after an observation beside the present one [m/s].

    Args:
        present: speed that was believed so far [m/s].
        noise: standard deviation of a length [m].
    """
    speeds = np.array(SPEEDS) * noise / 60.0
    rank = int(np.abs(speeds - present).argmin())
    others = speeds[max(rank - AT_ONCE, 0) : rank], speeds[rank + 1 :][:AT_ONCE]
    return list(np.concatenate(others).tolist())
