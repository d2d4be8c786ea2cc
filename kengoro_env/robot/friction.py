"""Dry friction that follows a wire's tension, as a rope's over a pulley does.

MuJoCo's friction cannot follow a force by itself: its arrays are written in each time step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.types import Floats


class GrowingFriction:
    """Friction at some places of one of a model's arrays (k,), in proportion to actuators' forces.

    Args:
        model: whose friction elsewhere is constant, and at these places what it is without force.
        field: the array's name, ``tendon_frictionloss`` or ``dof_frictionloss``.
        places: (p,) indices in it.
        actuators: (p,) whose forces count there.
        ratios: (p,) friction per force [1], with the sign that the force of a pull has.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        field: str,
        places: NDArray[np.int64],
        actuators: NDArray[np.int64],
        ratios: Floats,
    ) -> None:
        self._field = field
        constant = getattr(model, field).copy()
        self._actuator = np.zeros(len(constant), dtype=np.int64)  # any where it does not count
        self._ratio = np.zeros(len(constant))
        self._actuator[places], self._ratio[places] = actuators, ratios
        self._constant = constant if constant.any() else None

    def follow(self, model: Any, data: Any) -> Callable[[], None]:
        """What lets a model's friction follow the forces in its data, of one robot or of many."""
        loss, take = getattr(model, self._field), data.actuator_force.take
        actuator, ratio, constant = self._actuator, self._ratio, self._constant

        def update() -> None:
            take(actuator, -1, loss, "clip")
            np.multiply(loss, ratio, loss)
            if constant is not None:
                np.add(loss, constant, loss)

        return update

    def layout(self, model: mujoco.MjModel) -> dict[str, int | Floats | NDArray[np.int64] | None]:
        """Its number of places and its arrays, by their names in control_step.c."""
        return {
            "count": len(self._ratio),
            "loss": getattr(model, self._field),
            "actuator": self._actuator,
            "ratio": self._ratio,
            "constant": self._constant,
        }
