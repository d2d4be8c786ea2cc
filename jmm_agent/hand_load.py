"""Mass of what the hand holds, from the tensions of the rests at which it holds it.

At a rest the tensions balance gravity, and a load of mass M adds its weight. The nominal moment
arms are wrong by errors E, which would make some tenths of a kilogram; but they are the same when
the hand is empty, and the rests of before show them (`Balance.mass`):

    (G(theta) + E)' T = tau(theta)              hand empty, marker observations so far
    (G(theta) + E)' T = tau(theta) + M w(theta)    with the load

Here w is the torque of 1 kg at the grip. While the hand holds something the map is not learned
(Kawaharazuka et al. 2018, sec. I); the commands pull with tensions that hold the load as well.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.settling import SettlingDetector, SettlingOptions
from jmm_agent.types import Floats
from jmm_agent.vision.balance import Balance, Loads

MOST = 20
"""Number of newest rests of either kind that are compared."""
CERTAIN = 2.0
"""Standard deviations from 0 from which on a mass is believed."""


class LoadedHand:
    """Torques of a robot that holds a load.

    Args:
        loads: without it.
        kinematics: of all joints that carry it.
        frame: that the load is at.
        mass: of the load [kg].
    """

    def __init__(
        self, loads: Loads, kinematics: ArmKinematics, frame: str, mass: float = 0.0
    ) -> None:
        self._loads, self._kinematics, self._frame = loads, kinematics, frame
        self._mass = mass

    @property
    def acceleration(self) -> Floats:
        """Acceleration of gravity in the world's axes (3,) [m/s^2]."""
        return self._loads.acceleration

    def gravity(self, posture: Floats) -> Floats:
        """Torques of gravity and springs on the joints (n,) [N m].

        Args:
            posture: joint angles (n,) [rad].
        """
        return self._loads.gravity(posture) + self._mass * self.weight(posture)

    def weight(self, posture: Floats) -> Floats:
        """Torques of 1 kg at the frame on the joints (n,) [N m/kg].

        Args:
            posture: joint angles (n,) [rad].
        """
        rotation = self._kinematics.pose(self._frame, posture)[:3, :3]
        slope = self._kinematics.frame_jacobian(self._frame, posture)[:3]
        return np.asarray(self.acceleration @ rotation @ slope)


class HandLoad:
    """Estimates what the hand holds.

    Args:
        loads: torques that the nominal model needs to hold a posture.
        balance: of tensions and loads.
        kinematics: of all joints.
        frame: that a load is at.
        settling: when lengths count as settled.

    Attributes:
        mass: of the load [kg]; 0 for an empty hand, and before the first rest with a load.
        std: its standard deviation [kg]; infinite before the first rest with a load.
        loads: torques with the load, as far as it is certain.
    """

    def __init__(
        self,
        loads: Loads,
        balance: Balance,
        kinematics: ArmKinematics,
        frame: str,
        settling: SettlingOptions,
    ) -> None:
        self._empty, self._balance, self._kinematics = loads, balance, kinematics
        self._frame, self._settling = frame, SettlingDetector(settling)
        self.clear()

    def clear(self) -> None:
        """Forget the load, because the hand is empty."""
        self._angles: list[Floats] = []
        self._tensions: list[Floats] = []
        self.mass, self.std = 0.0, np.inf
        self.loads: Loads = self._empty
        self._settling.reset()

    @property
    def rests(self) -> int:
        """Number of rests at which the hand held the load."""
        return len(self._angles)

    def update(
        self,
        time: float,
        lengths: Floats,
        tensions: Floats,
        q: Floats,
        empty: Callable[[], tuple[Floats, Floats]],
    ) -> bool:
        """Add readings of a control step in which the hand holds something.

        Args:
            time: of the readings [s].
            lengths: measured (m,) [m].
            tensions: measured (m,) [N].
            q: estimated joint angles (n,) [rad].
            empty: gives joint angles (K, n) [rad] and tensions (K, m) [N] of rests without a load;
                called once per rest.

        Returns:
            Whether the estimate changed, as once per rest.
        """
        if not self._settling.update(time, lengths) or not np.isfinite(tensions).all():
            return False
        self._angles = [*self._angles, q.copy()][-MOST:]
        self._tensions = [*self._tensions, np.array(tensions)][-MOST:]
        hand = LoadedHand(self._empty, self._kinematics, self._frame)
        angles, pulled = (part[-MOST:] for part in empty())
        weights = np.array([hand.weight(one) for one in self._angles])
        self.mass, self.std = self._balance.mass(
            np.vstack([angles, self._angles]),
            np.vstack([pulled, self._tensions]),
            np.vstack([np.zeros_like(angles), weights]),
        )
        certain = self.mass > CERTAIN * self.std
        mass = self.mass if certain else 0.0
        self.loads = LoadedHand(self._empty, self._kinematics, self._frame, mass)
        return True
