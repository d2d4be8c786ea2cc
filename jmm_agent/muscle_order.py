"""Order and signs of a robot's interface, where they differ from those of the nominal model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class MuscleOrder:
    """Converts readings of a robot's m channels to those of an agent's muscles, and commands back.

    Channels without a muscle of the agent, such as those of an absent one, are commanded the length
    that they have: their motors pull with T_bias.

    Attributes:
        muscles: names of the agent's k muscles.
        channels: number of the robot's channels m.
        commands: channel that moves each muscle (k,).
        lengths: channel that reads the length of each muscle (k,).
        tensions: channel that reads the tension of each muscle (k,).
        command_signs: 1, or -1 for a motor that is reversed (k,).
        length_signs: the same of the encoders (k,).
        tension_signs: the same of the tension sensors (k,).

    Raises:
        AgentError: an array does not fit, a channel is used twice, or a sign is not 1 or -1.
    """

    muscles: tuple[str, ...]
    channels: int
    commands: Ints
    lengths: Ints
    tensions: Ints
    command_signs: Floats
    length_signs: Floats
    tension_signs: Floats

    def __post_init__(self) -> None:
        count = len(self.muscles)
        for name in ("commands", "lengths", "tensions"):
            order = np.array(getattr(self, name), dtype=np.intp)
            known = order.shape == (count,) and len(set(order.tolist())) == count
            if not known or (order.size and not 0 <= order.min() <= order.max() < self.channels):
                raise AgentError(
                    f"MuscleOrder: {name} is {order.tolist()}, but must be {count} different "
                    f"channels from 0 to {self.channels - 1}."
                )
            object.__setattr__(self, name, order)
        for name in ("command_signs", "length_signs", "tension_signs"):
            signs = np.array(getattr(self, name), dtype=float)
            if signs.shape != (count,) or not np.isin(signs, (-1.0, 1.0)).all():
                raise AgentError(f"MuscleOrder: {name} must be {count} numbers, each 1 or -1.")
            object.__setattr__(self, name, signs)

    @property
    def idle(self) -> Bools:
        """Channels that move no muscle of the agent (m,)."""
        idle = np.ones(self.channels, dtype=bool)
        idle[self.commands] = False
        return idle

    @property
    def changes(self) -> bool:
        """Whether it differs from the order of the nominal model."""
        order = np.arange(self.channels)
        orders = (self.commands, self.lengths, self.tensions)
        signs = (self.command_signs, self.length_signs, self.tension_signs)
        same = all(np.array_equal(each, order) for each in orders)
        return not (same and all((each > 0.0).all() for each in signs))

    def readings(self, readings: SensorReadings) -> SensorReadings:
        """Readings of the agent's muscles.

        Args:
            readings: of the robot's channels.

        Raises:
            AgentError: there are not m lengths and m tensions.
        """
        lengths, tensions = (np.asarray(each) for each in (readings.lengths, readings.tensions))
        if not lengths.shape == tensions.shape == (self.channels,):
            raise AgentError(
                f"MuscleOrder: lengths and tensions have shapes {lengths.shape} and "
                f"{tensions.shape}, but the robot has {self.channels} channels."
            )
        return readings._replace(
            lengths=lengths[self.lengths] * self.length_signs,
            tensions=tensions[self.tensions] * self.tension_signs,
            temperatures=self._temperatures(readings.temperatures),
        )

    def stiffness(self, muscles: Floats, idle: float) -> Floats:
        """K_stiff of the motors of the robot's channels (m,) [N/m].

        Args:
            muscles: of the agent's muscles (k,) [N/m].
            idle: of channels without a muscle of the agent [N/m].
        """
        channels = np.full(self.channels, idle)
        channels[self.commands] = muscles
        return channels

    def _temperatures(self, channels: Floats | None) -> Floats | None:
        """Temperatures of the motors of the agent's muscles (k,) [degC]."""
        if channels is None:
            return None
        temperatures = np.asarray(channels, dtype=float)
        if temperatures.shape != (self.channels,):
            raise AgentError(
                f"MuscleOrder: temperatures have shape {temperatures.shape}, but the robot has "
                f"{self.channels} channels."
            )
        return temperatures[self.commands]

    def command(self, target_lengths: Floats, readings: SensorReadings) -> Floats:
        """Command of the robot's channels (m,) [m].

        Args:
            target_lengths: of the agent's muscles (k,) [m].
            readings: of the robot's channels.
        """
        lengths = np.asarray(readings.lengths, dtype=float)
        command = np.where(np.isfinite(lengths), lengths, 0.0)
        command[self.commands] = target_lengths * self.command_signs
        return command

    def __deepcopy__(self, memo: dict[int, Any]) -> MuscleOrder:
        """Itself, because it is immutable."""
        return self
