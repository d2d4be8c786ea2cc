"""Vision Updater: learns (theta_ik, l_target), theta_ik from the marker on the hand (sec. III-C).

Under stiffness control a muscle with l < l_target does not pull, and follows any command that is
long enough, so that its l_target holds no information. The tightest command that causes the
measured tensions is min(l, l_target), muscle by muscle, where commands are the map's lengths. It
holds what the arm sags. Where commands have a feed-forward of tensions the map holds the lengths
themselves, and the pair holds l. The paper's l_target is an option.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Learner, Pairs
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.updaters.assignment import Assignment, ObservationRecord
from jmm_agent.updaters.forecast import Forecast, why_not_applied
from jmm_agent.updaters.model_choice import with_likeliest_model
from jmm_agent.updaters.observation_check import USUAL, ObservationCheck
from jmm_agent.updaters.observation_fitter import ObservationFitter
from jmm_agent.updaters.rest_fitter import RestFitter, RestMemory
from jmm_agent.updaters.rewiring import Rewiring
from jmm_agent.updaters.unexpected_poses import CONTRADICTED, UNEXPECTED
from jmm_agent.updaters.vision_memory import Rested, Seen, VisionMemory
from jmm_agent.updaters.vision_options import PairLengths, VisionOptions
from jmm_agent.updaters.wiring_watch import WiringWatch
from jmm_agent.updaters.zeroing_watch import ZeroingWatch
from jmm_agent.vision.balance import Loads
from jmm_agent.vision.camera_unknowns import camera_of, corrected, corrected_observations
from jmm_agent.vision.hand_error import HandErrors, HandPostures
from jmm_agent.vision.hold_out import HoldOut
from jmm_agent.vision.marker_observation import Frames
from jmm_agent.vision.observation_fit import (
    MarkerObservation,
    PoseResidual,
)
from jmm_agent.vision.observation_prediction import ObservationPrediction
from jmm_agent.vision.permanent_elongation import elongations
from jmm_agent.vision.rest_fit import Rest


class VisionUpdater:
    """Learns (theta_ik, l_target) when the hand has settled and was seen (sec. III-C).

    Args:
        learner: holds the map.
        prior: prior of the map's error.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: of the updater.
        loads: torques that the nominal model needs to hold a posture; None if unknown.
        judged: postures at which the hand's error is expected; an update that does not lower it is
            not applied. None: all are applied.

    Attributes:
        forecast: predicts looks, and what updates are worth.
        hold_out: observations that are not learned from; None if none is held out.
        fired: number of updates.
        dropped: number of observations that were not learned from, by reason.
    """

    def __init__(
        self,
        learner: Learner,
        prior: MapPrior,
        marker_residual: PoseResidual,
        limits: Floats,
        options: VisionOptions,
        loads: Loads | None = None,
        judged: HandPostures | None = None,
    ) -> None:
        self._learner, self._prior = learner, prior
        self._limits, self._options = limits, options
        self._fitter = RestFitter(prior, marker_residual, limits, options, loads)
        self.forecast = Forecast(self._fitter, marker_residual, limits, options, judged)
        self._wiring = WiringWatch(self._fitter.wiring_evidence, prior, limits)
        self._check = ObservationCheck(prior.map, marker_residual, options)
        self._rewiring = Rewiring(self._fitter, self._check, options.observations.memory)
        self._zeroing = ZeroingWatch(marker_residual, limits, options)
        self._fits = ObservationFitter(self._fitter, marker_residual, limits, options)
        joints, muscles = len(learner.map.joints), len(learner.map.muscles)
        self._memory = VisionMemory.none(joints, muscles)
        hold_out = options.hold_out
        self.hold_out = None if hold_out is None else HoldOut(hold_out, joints, muscles)
        self._recent = options.observations.elongation_recent
        self._camera = camera_of(marker_residual)
        self.fired = 0
        self.dropped: dict[str, int] = {}

    @property
    def memory(self) -> VisionMemory:
        """All that is remembered; may be set to an earlier value."""
        return self._memory

    @memory.setter
    def memory(self, memory: VisionMemory) -> None:
        before, self._memory = self._memory, memory
        lost, earlier, rests = memory.assignment.left_out, before.rests, memory.rests
        changed = rests.zero is not earlier.zero or rests.widths != earlier.widths
        if lost != before.assignment.left_out:
            changed = True
            factors = memory.assignment.factors(memory.elongated.shape[1])
            self._fitter.leave_out(factors)  # they enter no further fit
        if changed:
            self._prior = self._fitter.prior(rests)
            self._learner.know(self._prior)

    @property
    def elongated(self) -> Floats:
        """Number of permanent elongations of each muscle since each observation (K, m)."""
        return self._memory.elongated

    @property
    def pairs(self) -> Pairs:
        """Remembered pairs, the newest last."""
        return self._memory.pairs

    @property
    def zeroings(self) -> int:
        """Number of zeroings of all lengths that were noticed."""
        return self._memory.zeroings

    @property
    def assignment(self) -> Assignment:
        """Which muscle each channel is. All lengths, tensions and pairs are in its order."""
        return self._memory.assignment

    @property
    def zero(self) -> Floats | None:
        """Posture at which the lengths were zeroed (n,) [rad]; None while it is unknown."""
        return self._memory.rests.zero

    def corrected(self, pose: Floats) -> Floats:
        """Pose (4, 4) in the camera of the model, of a marker that the camera showed."""
        camera = self._memory.rests.camera
        return pose if camera is None else corrected(pose, camera)

    def begin(self) -> None:
        """Begin an episode, before which lengths may have been zeroed anew."""
        self.memory = self._memory.begun(self._options.zeroing_least)

    def zeroed(self) -> None:
        """Open the offsets of all lengths, because they were zeroed anew; shapes stay."""
        self.memory = self._memory.zeroed(self._prior.zeroing_share)
        if not self._memory.observations and self.zero is not None:
            self.memory = self._memory._replace(rests=RestMemory())
            self._learner.map = self._prior.map
        if self.hold_out is not None:
            self.hold_out.forget()

    def repaired(self, muscle: int) -> None:
        """Open the offset of a muscle's length, because it was mounted anew; its shape stays.

        Args:
            muscle: its number.
        """
        self.memory = self._memory.repaired(muscle)
        if self.hold_out is not None:
            self.hold_out.repaired(muscle)

    def doubt(self, muscle: int) -> None:
        """Count a muscle's length as unknown in all that is remembered: it followed nothing.

        Args:
            muscle: its number.
        """
        self.memory = self._memory.doubted(muscle)

    def rested(self, rest: Rest) -> Rested | None:
        """Remember a rest in which the hand was not seen, or not yet.

        Before the first observation, enough of them tell at which posture the lengths were zeroed;
        the map is then learned from all of them.

        Args:
            rest: the rest.

        Returns:
            What was learned; None if nothing was.
        """
        memory = self._memory
        rests = self._fitter.remembered(memory.rests, rest)
        if rests is memory.rests:
            return None
        self.memory = memory._replace(rests=rests)
        enough = self._fitter.shows_zero(rests) and self._learner.uses_prior
        if memory.observations or not enough:
            return None
        found = self._fitter.fit(rests, [], memory.angles, memory.elongated).memory
        moved = self._moves_zero(found)
        self.memory = memory._replace(rests=found)
        pairs = Pairs(
            np.array([one.guess for one in found.rests]),
            np.array([one.lengths for one in found.rests]),
            np.full(len(found.rests), self._options.noise),
        )
        before = self._learner.map
        self._learner.learn(pairs.last(1), Pairs(*(part[:-1] for part in pairs)))
        if self._judge(before)[1]:
            return None
        return Rested(found.rests[-1].guess, moved)

    def seen(
        self,
        pose: Floats,
        estimate: Floats,
        lengths: Floats,
        target: Floats,
        tensions: Floats,
        antagonism: Pairs | None = None,
        learn: bool = True,
        frames: Frames | None = None,
        covariance: Floats | None = None,
        joint_angles: Floats | None = None,
        time: float = np.nan,
    ) -> Seen:
        """Evaluate one observation of the settled hand, and learn from it.

        Args:
            pose: measured pose_marker_in_camera (4, 4), or the pose of ``frames``.
            estimate: theta_est (n,) [rad].
            lengths: l (m,) [m].
            target: l_target (m,) [m].
            tensions: (m,) [N].
            antagonism: pairs that the Antagonism Updater remembers.
            learn: if False, nothing is remembered and the map stays.
            frames: see `MarkerObservation`; as well as ``covariance`` and ``joint_angles``.
            time: of the observation [s]; NaN: unknown.
        """
        self._age(time if learn else np.nan)
        observation = MarkerObservation(
            pose, lengths, estimate, frames, covariance, joint_angles, tensions
        )
        most = self._options.observations.memory
        observations = [*self._memory.observations, observation][-most:]
        predicted = self.forecast.predict(self.memory, observations) if learn else None
        zeroed = learn and self._shows_zeroing(observations)
        fitted = self._fits.fit if learn else self._fits.evaluate
        found = fitted(self._memory, self._prior, observations)
        fit, angles = found.observed, found.observed.angles[-1]
        doubt = self._check.doubt(fit, observation, self._memory.angles)
        if learn:
            doubt = self._with_unexpected(doubt, predicted, zeroed)
        detail = self._check.detail(doubt, observation, angles)
        moved = self._moves_zero(found.memory)
        seen = Seen(angles, estimate - angles, False, doubt, zeroed, detail, moved, predicted)
        if not learn:
            return seen
        command = _pair_lengths(self._options.lengths, lengths, target)
        sound = not bool(np.any(tensions >= self._options.saturation))  # NaN: not known
        if seen.reason:
            self._refuse(ObservationRecord(observation, command, sound), seen.reason)
            return seen
        pair = Pairs(angles[None], command[None], np.array([self._options.noise]))
        if sound and self.hold_out is not None and self.hold_out.keeps(pair):
            return seen._replace(reason="held back, to test updates on it")
        map_before, before = self._learner.map, self.memory
        found = with_likeliest_model(self._fitter, found, observations)
        self.memory = before.believed(observations, found, command, sound, self._recent)
        self._forget_contradicted()
        self._learn(self.pairs.last(0) if antagonism is None or zeroed or moved else antagonism)
        return self._tested(seen, map_before, before)

    def _age(self, time: float) -> None:
        """Let what is remembered grow older, to a time [s]; NaN: unknown."""
        if not np.isnan(time):
            rests = self._memory.rests
            rests = rests._replace(drift=rests.drift.at(time))
            self.memory = self._memory._replace(rests=rests)

    def _with_unexpected(
        self, doubt: str, predicted: ObservationPrediction | None, zeroed: bool
    ) -> str:
        """Why a look is not believed, if it is the first that is far from its prediction, too."""
        unexpected = self.forecast.is_unexpected(predicted)
        first = unexpected and not (zeroed or self._memory.unexpected)
        self.memory = self._memory._replace(unexpected=unexpected)
        return doubt or (UNEXPECTED if first else "")

    def _forget_contradicted(self) -> None:
        """Forget the remembered pose that all others contradict, and fit them again without it."""
        number = self.forecast.contradicted(self._memory)
        if number is None or number == len(self._memory.observations) - 1:
            return
        self.drop(CONTRADICTED)
        memory = self._memory.without(number)
        known = memory.rests, memory.observations, memory.angles, memory.elongated
        found = self._fitter.fit(*known)
        self.memory = memory._replace(
            angles=found.observed.angles, elongated=found.elongated, rests=found.memory
        )

    def _tested(self, seen: Seen, map_before: JointMuscleMap, before: VisionMemory) -> Seen:
        """The result of an update, which is undone if it made the map worse."""
        if self.hold_out is not None and self.hold_out.harmed(map_before, self._learner.map):
            self._learner.map, self.memory = map_before, before
            seen = seen._replace(reason="undone: it made the map worse at held-out observations")
            self.drop(seen.reason)
            return seen
        expected, refused = self._judge(map_before)
        self.fired -= bool(refused)
        return seen._replace(learned=not refused, reason=refused, hand_error=expected)

    def _judge(self, before: JointMuscleMap) -> tuple[HandErrors | None, str]:
        """Expected errors of the hand by an update, and why it is not applied; then it is undone.

        What was observed is remembered in any case.
        """
        expected = self.forecast.hand_error(self.memory, before, self._learner.map)
        if refused := why_not_applied(expected):
            self._learner.map = before
            self.drop(refused)
        return expected, refused

    def find_miswiring(self) -> bool:
        """Whether observations show muscles that are not those of the nominal model, for once.

        They are then exchanged or left out, and all is learned again from what is remembered. None
        is looked for by observations in which a length is unknown, because a muscle was out of use.
        """
        if not (self._fitter.enabled and self._learner.uses_prior):
            return False
        memory, rests = self._memory, self._memory.rests.rests
        lengths = [one.lengths for one in memory.observations] + [one.lengths for one in rests]
        if np.isnan(lengths).any():
            return False
        shown = corrected_observations(memory.observations, memory.rests.camera, self._camera)
        found = self._wiring.found(self.assignment, shown, rests, self.elongated)
        if found is None:
            return False
        may = self._wiring.may_leave_out(self.assignment, found.muscles)
        muscles = self.elongated.shape[1]
        self.rewire(self.assignment.finding(found, muscles, may))
        return True

    def find_misplaced(self) -> bool:
        """Whether observations that were not believed fit if the joints are not as drawn.

        They are then learned from, too.
        """
        if not (self._fitter.enabled and self._learner.uses_prior):
            return False
        found = self._rewiring.with_misplaced(self._memory)
        if found is None:
            return False
        self.memory = found
        self._learn_again()
        return True

    def rewire(self, assignment: Assignment) -> None:
        """Learn all again with another wiring.

        Args:
            assignment: the wiring.
        """
        if assignment is self.assignment:
            return
        before = self._memory
        self.memory = before._replace(assignment=assignment)
        self.memory = self._rewiring.fitted(before, assignment)
        if self._memory.observations:
            self._learn_again()

    def _learn_again(self) -> None:
        """Learn all that is remembered, which has another meaning than before."""
        if self.hold_out is not None:
            self.hold_out.forget()
        self._learn(self.pairs.last(0))

    def _refuse(self, record: ObservationRecord, reason: str) -> None:
        """Keep an observation that is not believed, as evidence of other muscles and joints."""
        self.drop(reason)
        if reason not in (*USUAL, UNEXPECTED):
            assignment = self.assignment.refusing(record)
            self.memory = self._memory._replace(assignment=assignment)

    def drop(self, reason: str) -> None:
        """Count an observation that was not learned from.

        Args:
            reason: key in `dropped`.
        """
        self.dropped[reason] = self.dropped.get(reason, 0) + 1

    def _moves_zero(self, found: RestMemory) -> bool:
        """Whether a zero posture is far from the one that was known."""
        if found.zero is None:
            return False
        moved = found.zero if self.zero is None else found.zero - self.zero
        return bool(np.linalg.norm(moved) > self._options.distance)

    def _shows_zeroing(self, observations: list[MarkerObservation]) -> bool:
        """Whether the first observations since a start show that lengths were zeroed anew."""
        before = self.zeroings
        self.memory = self._zeroing.judged(self.memory, self._prior, observations)
        if self.zeroings == before:
            return False
        if self.hold_out is not None:
            self.hold_out.forget()
        return True

    def _learn(self, antagonism: Pairs) -> None:
        """Learn all pairs again, because a new observation changes the fit of the earlier ones.

        Lengths from before a permanent elongation are moved to what they would be now. A command is
        not the length of a posture in which a joint is at its stop; a measured length is.
        """
        options, memory = self._options, self._memory
        low = self._limits[:, 0] + options.stop_margin
        high = self._limits[:, 1] - options.stop_margin
        free = np.all((memory.angles > low) & (memory.angles < high), axis=1)
        if options.lengths == "l":
            free[:] = True
        use = free & np.array(memory.sound)
        if not memory.sound[-1]:
            self.drop("a muscle was saturated: no pair")
        elif not free[-1]:
            self.drop("a joint was at its stop: no pair")
        noise = np.full(len(use), options.noise)
        prior = self._prior.with_drift(memory.rests.drift.covariance)
        longer = elongations(memory.observations, prior, memory.angles, memory.elongated)
        lengths = np.array(memory.commands) - longer
        seen = Pairs(memory.angles[use], lengths[use], noise[use])
        pairs = self._pairs_of_rests().joined(seen)
        self.memory = memory._replace(pairs=pairs)
        new = pairs.last(int(use[-1]))
        earlier = Pairs(*(part[: len(part) - len(new.noise)] for part in pairs))
        self._learner.learn(new, earlier.joined(antagonism))
        self.fired += 1

    def _pairs_of_rests(self) -> Pairs:
        """Pairs of rests without an observation, at the angles of the fit of all rests."""
        rests = self._memory.rests.rests if self._fitter.enabled else ()
        joints, muscles = len(self._limits), self._memory.elongated.shape[1]
        angles = np.array([one.guess for one in rests]).reshape(-1, joints)
        lengths = np.array([one.lengths for one in rests]).reshape(-1, muscles)
        return Pairs(angles, lengths, np.full(len(rests), self._options.noise))


def _pair_lengths(kind: PairLengths | None, lengths: Floats, target: Floats) -> Floats:
    if kind == "l_target":
        return np.where(np.isnan(lengths), np.nan, target)
    return lengths if kind == "l" else np.minimum(lengths, target)
