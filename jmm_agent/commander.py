"""Commands: the next point of a trajectory, mapped to target muscle lengths within limits.

The trajectory pauses in gaps of the time stamps (`GapDetector`). Commands are shorter than the
map's lengths by what makes muscles pull with the tensions of the posture (`FeedForward`). After a
movement they may go on to where the estimated posture is the target (`PostureFeedback`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jmm_agent.command_limits import CommandLimits
from jmm_agent.errors import AgentError
from jmm_agent.feed_forward import FeedForward, stretch
from jmm_agent.gap_detector import GapDetector
from jmm_agent.guard.faults import MotorControl
from jmm_agent.map_transition import MapTransition
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.posture_feedback import PostureFeedback
from jmm_agent.trajectory import Trajectory
from jmm_agent.types import Bools, Floats, Ints

BEYOND = 0.1
"""How far beyond its limits a joint may be sent without a warning [rad], [m], or as a share of its
range [1], whichever is less."""


class Commander:
    """Follows a trajectory with target muscle lengths.

    Args:
        jmm: the joint-muscle mapping.
        start: joint angles (n,) [rad], the first target.
        joint_limits: lower and upper limits of the joints (n, 2) [rad].
        rate: largest speed at which commands follow a changed map [m/s].
        feed_forward: tensions along a movement; None: commands are the map's lengths.

    Attributes:
        time: of the newest control step [s]; -inf before the first of an episode.
        target_lengths: newest command (m,) [m].
        stretch: by how much it is shorter than the map's lengths (m,) [m].
        feedback: of the posture, at rest; None: there is none.
        tensions: with which muscles then pull at the posture (m,) [N]; None: unknown.
    """

    def __init__(
        self,
        jmm: JointMuscleMap,
        start: Floats,
        joint_limits: Floats,
        rate: float,
        feed_forward: FeedForward | None = None,
    ) -> None:
        self._limits = joint_limits
        self._gaps = GapDetector()
        self._trajectory = Trajectory(np.array([start, start]), 0.0, 0.0)
        self._feed_forward = feed_forward
        self._used = _used(feed_forward)
        self.feedback: PostureFeedback | None = None
        self.time = -np.inf
        self.target_lengths = jmm.lengths(start)
        self.stretch = np.zeros(len(jmm.muscles))
        self.tensions: Floats | None = None
        self._mapped: tuple[JointMuscleMap, Floats, Floats] | None = None
        self._back: Bools | None = None
        self._transition = MapTransition(len(jmm.muscles), rate)

    def reset(self) -> None:
        """Stay at the target until the first control step, as before a new episode."""
        self.time = -np.inf
        self._forget()
        self._trajectory = Trajectory(np.array([self.target, self.target]), 0.0, 0.0)

    def _forget(self) -> None:
        """Forget commands before, with which the next ones are not compared."""
        self._transition.reset()
        self._mapped = self._back = None
        self.stretch, self.tensions = np.zeros_like(self.stretch), None
        if self._feed_forward is not None:
            self._feed_forward.reset()
        if self.feedback is not None:
            self.feedback.reset()

    def come_back(self, muscles: Bools) -> None:
        """Continue from the last command of muscles (m,) that were commanded by others till now."""
        if muscles.any():
            self._back = muscles

    def reorder(self, order: Ints) -> None:
        """Continue with muscles in another order, while no channel's command jumps.

        Args:
            order: index before of what is now each muscle (m,).
        """
        self.target_lengths = self.target_lengths[order]
        self._transition.reorder(order)
        if self._mapped is not None:
            wanted = self._mapped[2] - self.stretch
            self._transition.begin(wanted - wanted[order])

    def recall(self, jmm: JointMuscleMap, posture: Floats) -> None:
        """Continue from the target of another time.

        Args:
            jmm: the joint-muscle mapping.
            posture: joint angles (n,) [rad].
        """
        self._trajectory = Trajectory(np.array([posture] * 2), 0.0, 0.0)
        self.target_lengths = jmm.lengths(posture)
        self._forget()

    @property
    def target(self) -> Floats:
        """Joint angles (n,) [rad] at the end of the trajectory."""
        return self._trajectory.points[-1]

    @property
    def ended(self) -> bool:
        """Whether the trajectory has ended."""
        return self.time >= self._trajectory.start + self._trajectory.duration

    def checked(self, postures: Floats, duration: float) -> Floats:
        """Postures (K, n) [rad] of a movement, clipped into the joint limits.

        Args:
            postures: joint angles (K, n) or (n,) [rad].
            duration: of the movement [s].

        Raises:
            AgentError: a posture is not finite or of the wrong shape, or there is none, or the
                duration is negative or not finite.
        """
        points = np.atleast_2d(np.asarray(postures, dtype=float))
        fits = points.shape[1:] == self.target.shape and len(points) > 0
        if not fits or not np.isfinite(points).all():
            raise AgentError(
                f"Agent: postures must be finite angles of {len(self.target)} joints, got shape "
                f"{points.shape}."
            )
        if not 0.0 <= duration < np.inf:
            raise AgentError(f"Agent: a duration must be finite and not negative: {duration} s.")
        low, high = self._limits.T
        return np.clip(points, low, high)

    def beyond(self, postures: Floats, joints: Sequence[str]) -> str:
        """Which joint of a movement is far beyond its limits, in one sentence; empty if none is.

        Args:
            postures: joint angles (K, n) or (n,) [rad], before they are clipped.
            joints: names of the n joints.
        """
        points = np.atleast_2d(np.asarray(postures, dtype=float))
        low, high = self._limits.T
        over = np.maximum(low - points, points - high) - BEYOND * np.minimum(1.0, high - low)
        posture, joint = divmod(int(over.argmax()), len(joints))
        if over[posture, joint] <= 0.0:
            return ""
        return (
            f"Joint {joints[joint]!r} goes to its limit: {points[posture, joint]:.4g} was asked "
            f"for, and its range is {low[joint]:.4g} to {high[joint]:.4g}; postures are in rad "
            "or m."
        )

    def go(self, points: Floats, duration: float) -> None:
        """Move through postures within a time.

        Args:
            points: joint angles (K, n) [rad], as `checked` returns them.
            duration: of the movement [s].
        """
        points = np.vstack([self._trajectory.at(self.time), points])
        self._trajectory = Trajectory(points, self.time, duration)

    def start(self, here: Floats, time: float, lengths: Floats) -> None:
        """Begin the trajectory where the arm is, or stay there without one.

        Args:
            here: estimated joint angles (n,) [rad].
            time: of the first control step [s].
            lengths: measured muscle lengths (m,) [m].
        """
        self._gaps = GapDetector()
        self.target_lengths = lengths  # the limits' rate counts from here
        given = self._trajectory.start == self.time
        points = self._trajectory.points[1:] if given else here[None]
        self._trajectory = Trajectory(np.vstack([here, points]), time, self._trajectory.duration)

    def advance(self, time: float) -> float:
        """Go on to a control step; the trajectory pauses in a gap.

        Args:
            time: of the step [s].

        Returns:
            Time since the command before [s], without the gap.
        """
        gap = self._gaps.update(time)
        self._trajectory = self._trajectory.paused(gap) if gap else self._trajectory
        passed = time - self.time - gap if np.isfinite(self.time) else self._gaps.period
        self.time = time
        return passed

    def command(
        self,
        jmm: JointMuscleMap,
        limits: CommandLimits | None,
        lengths: Floats,
        passed: float,
        motors: MotorControl | None = None,
        here: Floats | None = None,
    ) -> Floats:
        """Target lengths (m,) [m] at the present point of the trajectory, within limits.

        Args:
            jmm: the joint-muscle mapping.
            limits: of rate and tension; None for none.
            lengths: measured muscle lengths (m,) [m].
            passed: time since the command before [s].
            motors: gains and limit; None if unknown, and then there is no feed-forward.
            here: estimated joint angles (n,) [rad]; None while they are not believed.
        """
        q, known = self._posture(here, passed), self._mapped
        forward, used = self._feed_forward, self._used
        self._used = _used(forward)
        before, same = None, all(a is b for a, b in zip(self._used, used, strict=True))
        if known is not None and (known[0] is not jmm or not same or self._back is not None):
            before = known[0].lengths(q) - self.stretch
        if before is not None and self._back is not None:
            before, self._back = np.where(self._back, self.target_lengths, before), None
        if forward is not None and motors is not None:
            pull = forward.tensions(jmm, motors, self._trajectory, self.time)
            self.stretch, self.tensions = stretch(jmm, motors, pull), pull
        wanted = self._lengths_at(jmm, q) - self.stretch
        if before is not None:
            self._transition.begin(wanted - before)
        wanted += self._transition.advance(passed)
        if limits is None:
            return wanted
        return limits.applied(wanted, self.target_lengths, lengths, passed)

    def _posture(self, here: Floats | None, passed: float) -> Floats:
        """Present point of the trajectory (n,) [rad], corrected by the estimate up to a stop."""
        q = self._trajectory.at(self.time)
        if self.feedback is None:
            return q
        error = self.target - here if self.ended and here is not None else None
        self.feedback.advance(passed, error)
        low, high = self._limits.T
        return np.clip(q + self.feedback.correction, np.minimum(low, q), np.maximum(high, q))

    def remaining(self) -> tuple[Floats, float]:
        """Postures (K, n) [rad] that remain, the target last, and the time left [s]."""
        trajectory = self._trajectory
        count = max(1, int(np.ceil(trajectory.remaining(self.time))))
        begun = np.isfinite(self.time) and self.time > trajectory.start
        passed = self.time - trajectory.start if begun else 0.0
        return trajectory.points[-count:], max(0.0, trajectory.duration - passed)

    def missed(self, q: Floats, joints: Sequence[str], arrival: float) -> str:
        """Which joint is away from its target after the trajectory; empty if none is.

        Args:
            q: estimated joint angles (n,) [rad].
            joints: names of the joints.
            arrival: a joint that is farther from its target has not arrived [rad].
        """
        away = q - self.target
        worst = int(np.abs(away).argmax())
        if not self.ended or abs(away[worst]) <= arrival:
            return ""
        return f"Joint {joints[worst]!r} rests {np.degrees(away[worst]):+.1f} deg from its target."

    def _lengths_at(self, jmm: JointMuscleMap, q: Floats) -> Floats:
        """The map's lengths (m,) [m] at ``q`` (n,) [rad], computed again only if either changed."""
        if (
            self._mapped is None
            or self._mapped[0] is not jmm
            or not np.array_equal(self._mapped[1], q)
        ):
            self._mapped = jmm, q, jmm.lengths(q)
        return self._mapped[2].copy()


def _used(forward: FeedForward | None) -> tuple[object, ...]:
    """What tensions depend on beside map and motors; each changes its identity if it changes."""
    if forward is None:
        return (None,)
    distribution = forward.distribution
    return distribution.firm, distribution.loads, distribution.in_use
