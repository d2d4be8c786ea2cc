"""Options of a commissioning run."""

from __future__ import annotations

from dataclasses import dataclass, fields

from jmm_agent.errors import AgentError, positive


@dataclass(frozen=True)
class CommissionOptions:
    """How muscles are pulled, and when something is named; lengths and tensions are shares.

    Attributes:
        rest: time at rest before anything is pulled, in which noise is measured [s].
        tighten: longest time in which slack muscles are tightened [s].
        pretension: tension to which they are tightened beyond T_bias, as a share of the limit [1].
        tightened: by how much they are shortened at most, as a share of the travel [1].
        stroke: by how much a muscle is pulled, as a share of the travel [1] ...
        pull: ... but not by more than this additional tension, as a share of the limit [1].
        reach: how far a muscle that does not pull is shortened, as a share of the travel [1].
        tension: a pull ends where a tension exceeds this share of the limit [1].
        release: a muscle at rest above this share of the limit is released [1].
        ramp: duration of a stroke [s].
        settle: time after a stroke until the arm rests [s].
        measure: time in which readings are averaged [s].
        posture: standard deviation of the joint angles from those that are given, as a share of
            the joints' ranges [1].
        arms: standard deviation of moment arms, as a share of themselves [1].
        floor: standard deviation of responses by friction, as a share of the stroke [1].
        named: evidence from which on something is named [nat].
        factor: units and scales are named if they are off by this factor [1].

    Raises:
        AgentError: a number is not positive and finite, or ``factor`` is not above 1, or
            ``tension`` and ``release`` are not below 1.
    """

    rest: float = 1.0
    tighten: float = 3.0
    pretension: float = 0.03
    tightened: float = 0.25
    stroke: float = 0.12
    pull: float = 0.2
    reach: float = 1.5
    tension: float = 0.4
    release: float = 0.7
    ramp: float = 0.2
    settle: float = 0.3
    measure: float = 0.16
    posture: float = 0.15
    arms: float = 0.25
    floor: float = 0.04
    named: float = 15.0
    factor: float = 2.0

    def __post_init__(self) -> None:
        positive(
            "CommissionOptions", **{item.name: getattr(self, item.name) for item in fields(self)}
        )
        if self.factor <= 1.0:
            raise AgentError(f"CommissionOptions: factor is {self.factor}, but must be above 1.")
        if not self.tension <= self.release < 1.0:
            raise AgentError(
                f"CommissionOptions: tension is {self.tension} and release {self.release}, but "
                "tension may not be above release, and both must be below 1."
            )
