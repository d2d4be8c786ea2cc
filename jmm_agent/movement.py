"""Movement of the arm: which postures it goes to, and the commands that lead there.

Before a movement begins, it is checked whether the muscles can hold its postures. Those that they
cannot hold while some of them are out of use are replaced by the nearest that they can
(`PostureChoice`), also when a muscle is lost on the way. In each control step the next point of the
trajectory then becomes a command (`Commander`), with the stiffness of the muscles
(`MuscleStiffness`).
"""

from __future__ import annotations

import logging

import numpy as np

from jmm_agent.command_limits import CommandLimits
from jmm_agent.commander import Commander
from jmm_agent.feed_forward import FeedForward
from jmm_agent.guard.faults import Fault
from jmm_agent.heat.heat_monitor import HeatMonitor
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.learner import Learner
from jmm_agent.muscle_stiffness import MuscleStiffness
from jmm_agent.muscles_in_use import MusclesInUse
from jmm_agent.options import AgentOptions
from jmm_agent.posture_choice import Chosen, PostureChoice
from jmm_agent.posture_feedback import FeedbackOptions, PostureFeedback
from jmm_agent.statics import Statics, holds_of, not_reachable
from jmm_agent.tension_distribution import TensionDistribution, not_balanced
from jmm_agent.types import Floats

_log = logging.getLogger(__name__)

STOP = 1.0
"""Time in which commands go to where the arm is, because a tension stays at its limit [s]."""


class Movement:
    """Moves the arm through postures that the muscles in use can hold.

    Args:
        learner: holds the map.
        kinematics: of the arm.
        start: joint angles (n,) [rad], the first target.
        tensions: that hold a posture; None if the loads are unknown.
        in_use: which muscles are in use.
        options: of the agent.

    Attributes:
        commander: follows the trajectory.
        stiffness: of the muscles, with the motors' gains.
        unreachable: why postures of the newest movement cannot be reached; empty if all can.
    """

    def __init__(
        self,
        learner: Learner,
        kinematics: ArmKinematics,
        start: Floats,
        tensions: TensionDistribution | None,
        in_use: MusclesInUse,
        options: AgentOptions,
    ) -> None:
        self._learner, self._tensions, self._in_use = learner, tensions, in_use
        self._feeds_forward, muscles = options.feed_forward, len(learner.map.muscles)
        forward = FeedForward(tensions) if options.feed_forward and tensions else None
        limits, rate = kinematics.limits, options.map_rate
        self.commander = Commander(learner.map, start, limits, rate, forward)
        self._ranges = limits[:, 1] - limits[:, 0]
        self.feedback = options.feedback
        self.stiffness = MuscleStiffness(muscles, rate)
        self._choice = PostureChoice(kinematics, tensions, in_use)
        self._mask = in_use.mask
        self.unreachable = ""

    @property
    def faults(self) -> list[Fault]:
        """What is wrong with the newest movement."""
        return [] if self._choice.fault is None else [self._choice.fault]

    @property
    def feedback(self) -> FeedbackOptions | None:
        """Feedback of the posture at rest; None: there is none. It may be set at any time.

        What it has added to commands fades once it is None.
        """
        feedback = self.commander.feedback
        return None if feedback is None else feedback.options

    @feedback.setter
    def feedback(self, options: FeedbackOptions | None) -> None:
        feedback = self.commander.feedback
        if feedback is not None:
            feedback.options = options  # commands do not jump
        elif options is not None:
            self.commander.feedback = PostureFeedback(len(self._ranges), options, self._ranges)

    def go(
        self,
        postures: Floats,
        duration: float,
        goal: str | None,
        statics: Statics | None,
        heat: HeatMonitor | None,
    ) -> None:
        """Begin a movement; see `Agent.go`.

        Args:
            postures: joint angles (K, n) or (n,) [rad].
            duration: of the movement [s].
            goal: frame that is to be near where it would be; None: the joint angles are.
            statics: of the nominal model; None if unknown.
            heat: limits tensions; None: by nothing.

        Raises:
            AgentError: as `Agent.go`.
        """
        points = self.commander.checked(postures, duration)
        self._choice.set_goal(goal)
        chosen = Chosen(points, duration)
        now = self.commander.time, self._learner.map, self.stiffness.motors
        chosen = self._choice.choose(chosen, *now)
        beyond = self.commander.beyond(postures, self._learner.map.joints)
        not_held = self._not_held(chosen.points, statics, heat)
        self.unreachable = " ".join(filter(None, (beyond, *not_held)))
        if self.unreachable:
            _log.warning("%s", self.unreachable)
        self.commander.go(chosen.points, chosen.duration)

    def _not_held(
        self, points: Floats, statics: Statics | None, heat: HeatMonitor | None
    ) -> tuple[str, str]:
        """Why postures (K, n) [rad] cannot be held: by the muscles, and by the motors' heat."""
        not_held, hot = self._choice.sentence, ""
        if self._in_use.all:
            not_held = not_reachable(holds_of(statics, points))
        jmm, motors = self._learner.map, self.stiffness.motors
        if self._tensions is not None and motors is not None:
            pulls = [self._tensions.at(jmm, motors, q) for q in points]
            if not not_held and self._feeds_forward:
                not_held = not_balanced(pulls, jmm.joints, motors)
            if heat is not None:
                hot = heat.not_held(np.array([pull.tensions for pull in pulls]))
        return not_held, hot

    def stop(self, here: Floats, why: str) -> None:
        """Hold the arm where it is.

        Args:
            here: joint angles (n,) [rad].
            why: in some words, without a full stop.
        """
        self.commander.go(self.commander.checked(here, STOP), STOP)
        self.unreachable = f"The motion was stopped: {why}."
        _log.warning("%s", self.unreachable)

    def in_use_changed(self) -> None:
        """Check what remains of the movement with the muscles that are in use now."""
        in_use = self._in_use
        for fault in in_use.faults:
            if self._mask[in_use.index(fault.where)]:
                _log.warning("Muscle %s: %s.", fault.where, fault.detail)
        self._choice.in_use_changed()
        self.commander.come_back(in_use.mask & ~self._mask)
        self._mask = in_use.mask
        rest = Chosen(*self.commander.remaining())
        self._choice.begin(rest, self.commander.time, self._learner.map, self.stiffness.motors)

    def advance(self, passed: float) -> bool:
        """Go on by a control step, with another posture once it is known that one cannot be held.

        Args:
            passed: time since the command before [s].

        Returns:
            Whether the stiffness has changed.
        """
        changed, chosen = self.stiffness.advance(passed), self._choice.advance()
        if chosen is not None:
            self.unreachable = self._choice.sentence
            _log.warning("%s", self.unreachable)
            self.commander.go(chosen.points, chosen.duration)
        return changed

    def command(
        self, limits: CommandLimits | None, lengths: Floats, passed: float, here: Floats | None
    ) -> Floats:
        """Target lengths (m,) [m] of this control step.

        Args:
            limits: of rate and tension; None for none.
            lengths: measured (m,) [m].
            passed: time since the command before [s].
            here: estimated joint angles (n,) [rad]; None while they are not believed.
        """
        if limits is not None:
            limits = limits.with_stiffness(self.stiffness.commanded)
        motors = self.stiffness.motors
        return self.commander.command(self._learner.map, limits, lengths, passed, motors, here)
