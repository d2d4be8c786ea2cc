"""Dry friction in proportion to tension, as of a rope over a pulley.

MuJoCo's dry friction is a constant of the model, so its arrays are written in each time step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.types import Floats


class GrowingFriction:
    """Friction losses of a model, of which some entries grow with actuator forces.

    Args:
        model: a model that holds the friction without force.
        field: name of the array of friction losses, ``tendon_frictionloss`` or
            ``dof_frictionloss``.
        elements: indices of the entries that grow (p,).
        actuators: indices of the actuators whose forces count (p,).
        ratios: friction per force (p,) [1], with the sign of the force in a pull.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        field: str,
        elements: NDArray[np.int64],
        actuators: NDArray[np.int64],
        ratios: Floats,
    ) -> None:
        self._field = field
        constant = getattr(model, field).copy()
        self._actuator = np.zeros(len(constant), dtype=np.int64)  # any if the ratio is 0
        self._ratio = np.zeros(len(constant))
        self._actuator[elements], self._ratio[elements] = actuators, ratios
        self._constant = constant if constant.any() else None

    def follow(self, model: Any, data: Any) -> Callable[[], None]:
        """A function that updates the friction losses, of one robot or of many.

        Args:
            model: has the array of friction losses.
            data: has the forces of the actuators.
        """
        loss, take = getattr(model, self._field), data.actuator_force.take
        actuator, ratio, constant = self._actuator, self._ratio, self._constant

        def update() -> None:
            take(actuator, -1, loss, "clip")
            np.multiply(loss, ratio, loss)
            if constant is not None:
                np.add(loss, constant, loss)

        return update

    def layout(self, model: mujoco.MjModel) -> dict[str, int | Floats | NDArray[np.int64] | None]:
        """Values of the fields of ``Friction`` in control_step.c."""
        return {
            "count": len(self._ratio),
            "loss": getattr(model, self._field),
            "actuator": self._actuator,
            "ratio": self._ratio,
            "constant": self._constant,
        }
