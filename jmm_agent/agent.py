"""Agent: sensor readings in, target muscle lengths out; it learns while it moves (sec. III).

One control step

1. filters the readings (`Guard.filter`),
2. estimates the joint angles (`JointEstimator`, sec. II-D),
3. names faults (`Guard.watch`); after a new one, what was learned just before is taken back,
4. learns, if the lengths have settled: the Antagonism Updater at once (sec. III-B), the Vision
   Updater from the first frame that was taken at rest (sec. III-C),
5. maps the next point of the trajectory to muscle lengths and limits them (`Guard.limit`).

Step 2 is done by `ArmEstimate`, step 4 by `RestLearning`, from what `HandObserver` selects, and
step 5 by `Movement`, to which `Agent.go` gives the postures.

Sections are those of Kawaharazuka et al. 2018.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jmm_agent.arm_estimate import ArmEstimate
from jmm_agent.assembly import hand_load, map_learning
from jmm_agent.command_limits import CommandLimits
from jmm_agent.errors import AgentError
from jmm_agent.guard.arm_state import ArmState
from jmm_agent.guard.faults import MUSCLE_LEFT_OUT, MUSCLE_SNAPPED, Fault, MotorControl
from jmm_agent.guard.guard import Guard
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.hand_observer import HandObserver
from jmm_agent.heat.heat_monitor import HeatMonitor
from jmm_agent.joint_stiffness import Stiffness
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.job_queue import Entered
from jmm_agent.learning.memory import load_memory, memory_of
from jmm_agent.learning.options import AS_SOON
from jmm_agent.learning.schedule import Schedule
from jmm_agent.length_check import LengthCheck
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Rule
from jmm_agent.mapping.prior import PointWeights
from jmm_agent.memory_file import AgentMemory, write_memory
from jmm_agent.movement import Movement
from jmm_agent.muscle_order import MuscleOrder
from jmm_agent.muscles_in_use import MusclesInUse
from jmm_agent.next_posture import NextPosture, PlannerModel, PlannerState
from jmm_agent.observation import SensorReadings
from jmm_agent.options import AgentOptions
from jmm_agent.posture_feedback import FeedbackOptions
from jmm_agent.posture_planner import PosturePlanner, planner_apart
from jmm_agent.prediction_record import PredictionRecord
from jmm_agent.rest_learning import RestLearning
from jmm_agent.statics import Hold, Statics, holds_of
from jmm_agent.tension_distribution import TensionDistribution
from jmm_agent.tension_watch import TensionWatch
from jmm_agent.time_line import Tick, TimeLine
from jmm_agent.types import Floats
from jmm_agent.updaters import (
    AntagonismMemory,
    Seen,
    VisionMemory,
)
from jmm_agent.vision.balance import Loads
from jmm_agent.vision.camera_delay import DelayEstimate
from jmm_agent.vision.can_finder import CanDetection, CanFinder, CanSkip, can_of, checked_finder
from jmm_agent.vision.hand_detection import HandDetector
from jmm_agent.vision.hand_finder import HandSeen
from jmm_agent.vision.marker_detector import Detector, MarkerPose
from jmm_agent.vision.marker_observation import usual_noise
from jmm_agent.vision.pose_covariance import numbers
from jmm_agent.wiring import Wiring

__all__ = ["Agent", "AgentOptions"]

_log = logging.getLogger(__name__)


class Agent:
    """Estimates joint angles, learns the joint-muscle mapping and commands muscle lengths.

    Args:
        nominal_map: the map that was trained on the nominal model.
        kinematics: of the same n joints, in the map's order.
        detector: finds markers in frames; None for an agent without a camera, or without markers.
        typical: postures (N, n) [rad] that set the scale of the prior.
        start: joint angles (n,) [rad] at which it believes to start.
        rng: samples rehearsal pairs.
        options: of the agent and its parts; the defaults if left out.
        rule: how the map is moved by what is learned; the ridge rule if left out.
        guard: names faults, keeps them from being learned, and limits commands. Without one all
            readings are believed, and readings that are not finite are refused.
        loads: torques that the nominal model needs to hold a posture, which tensions are compared
            with, and which commands pull against; None if unknown.
        points: what displaced points of attachment do to the lengths, see
            `jmm_agent.mapping.point_weights`; None if unknown.
        hand: finds the hand in frames without a marker, for `VisionOptions(hand="seen")`.
        can: finds the can in frames without a marker, for `AgentOptions(can="seen")`.

    Attributes:
        guard: as given, or a `NullGuard`; may be replaced before an episode begins.
        limits: of rate and tension of the commands; None for those of the guard only. `drive` sets
            limits that derive from the map while there are none.
        heat: limits tensions by the temperatures of the motors; None: they are not watched.
        order: of the robot's muscles and their signs, where they differ from the map's, as found
            by a commissioning run; None if they do not.
        statics: of the nominal model, which say whether a posture can be reached; None if unknown.
        in_use: which muscles are in use; a guard leaves out those that have snapped.
        wiring: which muscles were found to be exchanged, and which are left out.
        learner: holds the map.
        antagonism: the Antagonism Updater.
        vision: the Vision Updater.
        estimator: estimates the joint angles.
        time_line: converts time stamps to the agent's own time, and counts skipped readings.
        hand_load: mass of what the hand holds while `hand_is_free` is False, with its standard
            deviation; commands pull with tensions that hold it. None without ``loads``.
        hand_is_free: False while the hand holds or touches something. The map is then left alone,
            because it holds only while no forces but gravity act (sec. I).

    Raises:
        AgentError: kinematics and map have different joints, a frame of the options or of the
            hand's detector is unknown, there is a detector without a camera, or not the one that
            the options name; the same of the can's finder.
    """

    limits: CommandLimits | None = None
    heat: HeatMonitor | None = None
    order: MuscleOrder | None = None
    statics: Statics | None = None

    def __init__(
        self,
        nominal_map: JointMuscleMap,
        kinematics: ArmKinematics,
        detector: Detector | None,
        typical: Floats,
        start: Floats,
        rng: np.random.Generator,
        options: AgentOptions | None = None,
        rule: Rule | None = None,
        guard: Guard | None = None,
        loads: Loads | None = None,
        points: PointWeights | None = None,
        hand: HandDetector | None = None,
        can: CanFinder | None = None,
    ) -> None:
        self.options = options = options or AgentOptions()
        self.kinematics = kinematics
        self._nominal_map, self._typical = nominal_map, typical
        self.guard: Guard | NullGuard = NullGuard() if guard is None else guard
        learned = map_learning(nominal_map, kinematics, typical, rng, options, rule, loads, points)
        self._learned, self.learner = learned, learned.learner
        self.antagonism, self.vision = learned.antagonism, learned.vision
        self._observer = HandObserver(detector, kinematics, options, hand)
        self._can = checked_finder(can, options.can, options.camera)
        self._schedule = Schedule(learned, options.learning, self._map_changed)
        self._rests = RestLearning(learned, self._schedule, self._observer, options)
        limits, self.in_use = kinematics.limits, MusclesInUse(nominal_map.muscles)
        self.time_line = TimeLine(options.time_line)
        self.estimator = JointEstimator(nominal_map, limits, options.estimator, start)
        self.estimator.spread = learned.spread
        self._arm = ArmEstimate(self.learner, self.estimator, self.in_use)
        self._tensions = None if loads is None else TensionDistribution(loads, options.tension)
        self.hand_load = hand_load(nominal_map, kinematics, options, loads)
        self._movement = Movement(
            self.learner, kinematics, start, self._tensions, self.in_use, options
        )
        self._commander, self._stiffness = self._movement.commander, self._movement.stiffness
        self._lengths, self.wiring = LengthCheck(nominal_map, limits), Wiring(nominal_map, limits)
        self._tension_watch = TensionWatch(nominal_map.muscles)
        self._step, self.hand_is_free = -1, True

    @property
    def map(self) -> JointMuscleMap:
        """The joint-muscle mapping as learned so far."""
        return self.learner.map

    @property
    def motors(self) -> MotorControl | None:
        """Gains and limit of the motors, which commands use; None if unknown. May be assigned."""
        return self._stiffness.motors

    @motors.setter
    def motors(self, motors: MotorControl | None) -> None:
        self._stiffness.motors = motors

    @property
    def stiffness(self) -> Floats | None:
        """K_stiff that the motors must have with the newest command (m,) [N/m], or None.

        None until `set_stiffness` was called: then they keep what they were made with.
        """
        commanded = self.wiring.stiffness(self._stiffness.commanded)
        if self.order is None or commanded is None or self.motors is None:
            return commanded
        return self.order.stiffness(commanded, self.motors.stiffness)

    @property
    def learning(self) -> bool:
        """Whether anything is learned.

        While False, marker observations are evaluated, but neither learned nor remembered.
        """
        return self._schedule.enabled

    @learning.setter
    def learning(self, learning: bool) -> None:
        self._schedule.enabled = learning

    @property
    def seen(self) -> Seen | None:
        """Result of the newest marker observation; None before the first."""
        return self._schedule.seen

    @property
    def predictions(self) -> PredictionRecord:
        """Marker observations beside what was expected of them before they were learned."""
        return self._schedule.predictions

    @property
    def taken_back(self) -> int:
        """Number of times that something was unlearned.

        This is done when it had been learned just before a fault was noticed.
        """
        return self._schedule.taken_back

    @property
    def entered(self) -> list[Entered]:
        """Control steps at which results entered that were computed beside the loop, in order."""
        return sorted([*self._observer.entered, *self._schedule.entered], key=lambda end: end.step)

    def replay(self, entered: Iterable[Entered]) -> None:
        """Let results enter at recorded steps, in place of `AgentOptions.learning`.

        Args:
            entered: recorded by another agent; see `AgentLog`, which calls this.
        """
        ends = list(entered)
        self._schedule.replay(end for end in ends if end.kind != "frame")
        self._observer.replay(end for end in ends if end.kind == "frame")

    @property
    def learning_process(self) -> int | None:
        """Number of the process that learns beside the control loop; None while there is none."""
        return self._schedule.process_id

    def finish_learning(self) -> None:
        """Wait until all that was observed is learned, as before what was learned is saved."""
        self._schedule.finish()

    def close(self) -> None:
        """Finish learning, and end process and thread beside the loop; they start again if needed.

        Both end with the program in any case.
        """
        self._schedule.close()
        self._observer.close()

    @property
    def nominal_map(self) -> JointMuscleMap:
        """The map that was trained on the nominal model."""
        return self._nominal_map

    @property
    def joint_angles(self) -> Floats:
        """Estimated joint angles (n,) [rad]."""
        return self.estimator.q

    @property
    def contradicted_joints(self) -> dict[str, float]:
        """Joints whose encoders contradict the muscle lengths, by the map as learned so far.

        Mean difference [rad] of each encoder from the joint angle by the lengths. Before the map is
        learned it may be the map that is wrong; after that the zero of the encoder is.
        """
        encoders = self.estimator.joint_encoders
        rows = zip(self.map.joints, encoders.contradicted, encoders.differences, strict=True)
        return {joint: float(missed) for joint, wrong, missed in rows if wrong}

    @property
    def camera_delay(self) -> DelayEstimate:
        """Delay of the camera, as given in the options or as estimated so far."""
        return self._observer.delay

    @property
    def markers(self) -> dict[int, MarkerPose]:
        """Markers in the newest frame in which they were detected, by id."""
        return self._observer.markers

    @property
    def hand(self) -> HandSeen | None:
        """The hand in the newest frame that was searched for it; None if it was not found.

        Its pose is in the camera as it is modelled.
        """
        hand = self._observer.hand
        return hand if isinstance(hand, HandSeen) else None

    @property
    def unreachable(self) -> str:
        """Why postures of the last `go` cannot be reached; empty if all can."""
        return self._movement.unreachable

    @property
    def target(self) -> Floats:
        """Joint angles (n,) [rad] at the end of the trajectory."""
        return self._commander.target

    @property
    def feedback(self) -> FeedbackOptions | None:
        """Feedback of the posture at rest; None: there is none. It may be set at any time.

        What it has added to commands fades once it is None.
        """
        return self._movement.feedback

    @feedback.setter
    def feedback(self, options: FeedbackOptions | None) -> None:
        self._movement.feedback = options

    @property
    def at_rest(self) -> bool:
        """Whether the lengths have settled and nothing remains to be learned from them."""
        return self._rests.done

    @property
    def faults(self) -> list[Fault]:
        """Faults that are found now, in the order in which they were noticed.

        Those of the robot, which a guard names, and those of the clock, of all lengths and of
        learning, which are named without a guard, too, and do not keep the agent from learning.
        """
        found = [*self.guard.faults, *self.time_line.found()]
        found += [*self._lengths.faults, *self._rests.faults, *self._tension_watch.faults]
        found += [] if self.heat is None else self.heat.faults
        found += self._movement.faults
        in_use = self.in_use.faults
        out = {fault.where for fault in in_use}
        found = [one for one in found if one.kind != MUSCLE_SNAPPED or one.where not in out]
        found += [*in_use, *(one for one in self.wiring.faults if one.where not in out)]
        return sorted(found, key=lambda fault: fault.since)

    def begin_episode(self) -> None:
        """Forget the state of the arm, as before a new episode; keep what was learned."""
        self.guard.reset()
        if self.heat is not None:
            self.heat.reset()
        self._rests.reset()
        self._lengths.reset()
        self.wiring.reset()
        self._tension_watch.reset()
        self.time_line.reset()
        self._commander.reset()
        if self._stiffness.finish():
            self._stiffness_changed()
        self.estimator.reset(self.target)
        if self.hand_load is not None:
            self.hand_load.clear()

    def go(self, postures: Floats, duration: float, goal: str | None = None) -> None:
        """Move through postures within a time.

        Before the first step of an episode the trajectory begins at the first estimate. Postures
        that the muscles cannot hold, or far beyond the joint limits, are logged, see `unreachable`.
        While muscles are out of use, the arm goes to the nearest that can be held in their stead,
        and the movement may take longer.

        Args:
            postures: joint angles (K, n) [rad] to pass, or the target (n,) [rad] alone; clipped
                into the joint limits.
            duration: of the movement [s].
            goal: frame, such as the hand, that is then to be near where it would be; None: the
                joint angles are.

        Raises:
            AgentError: a posture is not finite or of the wrong shape, or there is none, or the
                duration is negative or not finite, or there is no such frame.
        """
        self._movement.go(postures, duration, goal, self.statics, self.heat)

    def set_stiffness(
        self, value: ArrayLike | Mapping[str, float], limits: tuple[float, float] | None = None
    ) -> Stiffness:
        """Change the stiffness of the muscles, while the arm holds its posture.

        `stiffness` then goes from the present one to the new one in some control steps, and the
        commands with it. A `Session` and `drive` pass it to the robot. It stays until the next
        call, also after `load` and in further episodes.

        Args:
            value: K_stiff of all muscles, or of each (m,) [N/m]; or wanted stiffnesses of joints
                [N m/rad] by name, at the target posture. A joint's is what a push at it alone
                shows; joints that are not named get what follows.
            limits: lowest and highest K_stiff [N/m]; a twentieth and twice that of the motors as
                they were made, if left out.

        Returns:
            The stiffness of muscles and joints at the end, and whether it is what was wanted.

        Raises:
            AgentError: a value is out of range, a joint is unknown, the motors' gains are unknown,
                or joints are given and the loads are unknown; nothing is changed.
        """
        found = self._stiffness.change(
            value, limits, self.map, self.target, self._tensions, self._commander.tensions
        )
        if found.missed:
            _log.warning("%s", found.missed)
        return found

    def __deepcopy__(self, memo: dict[int, Any]) -> Agent:
        """An independent agent that continues from the present state, with the same kinematics."""
        memo[id(self.kinematics)] = self.kinematics
        other = type(self).__new__(type(self))
        memo[id(self)] = other
        other.__dict__.update(
            {name: deepcopy(value, memo) for name, value in self.__dict__.items()}
        )
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        """Refuse to pickle: a part of the agent holds what belongs to this process."""
        raise AgentError(
            "Agent: agents cannot be pickled; write what was learned with `save`, and `load` it "
            "into a new agent of the same robot."
        )

    def leave_out(self, muscle: str, why: str = "somebody has left it out") -> None:
        """Use a muscle no longer, as when it has snapped; see `jmm_agent.muscles_in_use`.

        Its motor must pull with T_bias at most. A guard leaves out snapped muscles by itself.

        Args:
            muscle: its name.
            why: in some words, for the fault that then stays.

        Raises:
            AgentError: there is no such muscle, or it is the last one.
        """
        time = max(self._commander.time, 0.0)
        if self.in_use.leave_out(muscle, time, why, MUSCLE_LEFT_OUT):
            self._in_use_changed()

    def repaired(self, muscle: str) -> None:
        """Use a muscle again that was left out, and has been mounted anew.

        Its length is off by an unknown number, which the next marker observation shows. Until then
        its motor pulls with T_bias, and its length counts for nothing else.

        Args:
            muscle: its name.

        Raises:
            AgentError: there is no such muscle.
        """
        index, assignment = self.in_use.index(muscle), self.vision.assignment
        seen = bool(self.vision.memory.observations)
        self._schedule.reset()
        if index in assignment.left_out:
            self.wiring.mended(index)
            self.vision.doubt(index)
            self.vision.rewire(assignment.mended(index))
        if self.in_use.repaired(muscle, offset_is_open=seen):
            self.vision.repaired(index)
            self.antagonism.repaired(index)
            self._in_use_changed()

    def reachable(self, postures: Floats) -> list[Hold]:
        """Whether the muscles can hold postures, by the nominal model.

        Args:
            postures: joint angles (K, n), or (n,) of one [rad], within the joint limits.

        Returns:
            A result for each posture; none if the agent has no statics.

        Raises:
            AgentError: a posture is not finite or of the wrong shape.
        """
        return holds_of(self.statics, postures)

    def next_posture(
        self, candidates: ArrayLike | None = None, within: float = np.inf
    ) -> NextPosture:
        """The posture at which to observe the hand next; `go` then moves there.

        See `jmm_agent.posture_planner`. It takes some tenths of a second; on a live robot call
        ``posture_planner().choose(candidates)`` in a thread beside the loop.

        Args:
            candidates: joint angles (C, n) [rad]; some of the typical postures if left out.
            within: time that the movement may take [s].

        Returns:
            The posture, how long the movement to it takes at least, and why it was chosen.

        Raises:
            AgentError: the candidates are not finite angles of all joints, none of them can be
                visited, or each observation is fitted alone.
        """
        return self.posture_planner().choose(candidates, within)

    def posture_planner(self) -> PosturePlanner:
        """Chooses the next posture by the present state, which later steps do not change."""
        limits = self.limits or CommandLimits.of(self.map, self.kinematics.limits)
        near = self.options.vision.distance, self.options.vision.stop_margin
        state = PlannerState(self.map, self.vision.memory, self.target, *near, limits)
        options, known = self.options, (self.kinematics, self._typical, self._observer.shows)
        frames = self._observer.frames or (options.marker_site, options.camera or None)
        noise = options.vision.observations
        if options.vision.hand == "seen":
            before = self.vision.memory.observations
            usual = usual_noise(before, noise.position_noise, noise.rotation_noise)
            noise = replace(noise, position_noise=usual[0], rotation_noise=usual[1])
        model = PlannerModel(self.vision.forecast, *known, frames, noise)
        return planner_apart(model, self.statics, self._tensions, self.motors, state)

    def missed(self) -> str:
        """Which joint rests away from its target by the estimate, and which muscles are too hot.

        Returns:
            A sentence for each; empty while the arm moves, or if each joint rests within
            `AgentOptions.arrival` of its target.
        """
        if not self.at_rest:
            return ""
        missed = self._commander.missed(self.joint_angles, self.map.joints, self.options.arrival)
        hot = self.heat.too_hot() if missed and self.heat is not None else ""
        return " ".join(filter(None, (missed, hot)))

    def step(self, readings: SensorReadings) -> Floats:
        """Run one control step.

        Args:
            readings: of m muscles. Those that are not later than the ones before are skipped and
                counted, see `TimeLine`.

        Returns:
            Target muscle lengths (m,) [m] for the next control period; the last ones for readings
            that were skipped.

        Raises:
            AgentError: readings that are not finite or of the wrong shape, and nothing is changed;
                or a frame of the wrong shape that was to be evaluated, and the map stays. A guard
                replaces readings that are not finite, as long as one length is finite.
        """
        self._rewire()
        muscles = readings if self.order is None else self.order.readings(readings)
        command = self._step_muscles(self.wiring.readings(muscles))
        command = self.wiring.command(command, muscles)
        return command if self.order is None else self.order.command(command, readings)

    def _step_muscles(self, readings: SensorReadings) -> Floats:
        """Run one control step with readings and target lengths of the map's muscles."""
        tick = self.time_line.tick(readings.time)
        if tick is None:
            return self._commander.target_lengths.copy()
        readings = self._filtered(readings, tick)
        if self.heat is not None:
            self.heat.update(readings, tick.jump)
        if np.isfinite(self._commander.time):
            self._arm.update(readings, tick.passed(self._commander.time))
        else:
            self._start(readings)
        passed = self._commander.advance(readings.time)
        self._step += 1
        self._observer.advance(self._step)
        self._watch_robot(readings)
        self._watch_hand(readings)
        self._watch_limit(readings, passed)
        self._rests.advance(self._step, readings.time, self.hand_is_free)
        since = self._rests.settling.since
        checked = readings._replace(tensions=self.in_use.demanded(readings.tensions))
        command = self._commander.target_lengths
        self._lengths.update(checked, command, self.motors, since)
        trusted = not self.guard.faults and self.hand_is_free
        target = self._commander.target_lengths + self._commander.stretch
        sample = self._arm.sample(readings, target)
        self._rests.learn(readings, sample, trusted, bool(tick.jump))
        if not self.guard.faults:
            self._rests.watch(
                readings,
                passed,
                self.hand_is_free,
                self._commander.ended,
                self.contradicted_joints,
            )
        if self._movement.advance(passed):
            self._stiffness_changed()
        here = None if self.guard.faults else self.joint_angles
        command = self._movement.command(self.limits, readings.lengths, passed, here)
        command = self.guard.limit(command)
        if self.heat is not None:
            command = self.heat.limit(command, readings.lengths)
        command = self.in_use.commanded(command, self._arm.measured)
        self._commander.target_lengths = command
        return self._commander.target_lengths.copy()

    def observe(
        self,
        pose: ArrayLike,
        covariance: ArrayLike,
        time: float,
        frame: str | None = None,
        relative_to: str | None = None,
    ) -> None:
        """Learn from a measured pose of the hand in place of a camera frame.

        It is learned from in a step at which it is known that the hand was at rest at that time:
        once per rest, with the muscle lengths of that time. Otherwise it is counted in
        ``vision.dropped``. Call it between control steps, not from another thread.

        Args:
            pose: measured pose of a frame (4, 4), translation in metres.
            covariance: of the pose (6, 6) [m^2, rad^2]: x, y, z and rotations about x, y, z, all in
                the axes of ``relative_to``. An infinite variance says that a number was not
                measured; without rotations only the position counts.
            time: of the measurement, on the clock of the sensor readings [s].
            frame: site, body or camera of the kinematics whose pose it is; the hand's marker if
                left out.
            relative_to: frame in which the pose is given; None or "world": world, the base of the
                nominal model.

        Raises:
            AgentError: an unknown frame, or one that no joint moves against ``relative_to``; a pose
                or covariance that is not valid; or a time that is not finite or in the future.
        """
        frames = frame or self.options.marker_site, relative_to
        own_time = self.time_line.own_time(float(numbers("time", time, ())))
        self._observer.add_pose(pose, covariance, own_time, frames)

    def detect_markers(self, readings: SensorReadings) -> dict[int, MarkerPose]:
        """Markers in the newest frame, by id; empty without a frame.

        Poses are in the camera as it is believed to be, see `camera_unknowns`.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        found, vision = self._observer.detect(readings, self.estimator.q), self.vision
        poses = {name: vision.corrected(one.pose_marker_in_camera) for name, one in found.items()}
        return {name: replace(found[name], pose_marker_in_camera=poses[name]) for name in found}

    def detect_can(self, readings: SensorReadings) -> CanDetection | CanSkip:
        """The can in the newest frame, by the marker on it or by its shape, or why it has no pose.

        The pose is that of its marker, or of the middle of its upper end, in the camera as it is
        believed to be, see `camera_unknowns`.

        Args:
            readings: of this control step.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        if readings.frame is None:
            return CanSkip.NO_FRAME
        if self._can is None:
            marker = self.detect_markers(readings).get(self.options.can_marker)
            return CanSkip.NOT_SEEN if marker is None else can_of(marker)
        turn = self.kinematics.pose(self.options.camera, self.estimator.q)[:3, :3]
        found = self._can.detect(readings.frame, turn[2])
        if isinstance(found, CanSkip):
            return found
        return replace(found, pose_can_in_camera=self.vision.corrected(found.pose_can_in_camera))

    def recall(
        self, jmm: JointMuscleMap, antagonism: AntagonismMemory, vision: VisionMemory
    ) -> None:
        """Return to what was learned at another time.

        Args:
            jmm: the map.
            antagonism: what the Antagonism Updater remembered.
            vision: what the Vision Updater remembered.
        """
        self._schedule.recall(jmm, antagonism, vision)

    @property
    def memory(self) -> AgentMemory:
        """All that was learned until now; later steps do not change it."""
        in_use = None if self.in_use.all else self.in_use.state()
        return memory_of(self._learned, self.target, in_use)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all that was learned to a file, whole or not at all.

        What was observed until now is learned first, which may take a second. `write_memory` writes
        `memory` without that, for instance in another thread.

        Args:
            path: of the file; its folder is made.
        """
        self.finish_learning()
        write_memory(path, self.memory, self._nominal_map)

    def load(self, path: str | os.PathLike[str]) -> None:
        """Continue from what `save` wrote, with a new episode.

        An agent of the same nominal map and options then learns and moves as the one that was
        saved, to the bit.

        Args:
            path: of the file.

        Raises:
            CheckpointError: the file is missing or damaged, or does not fit this robot; nothing is
                changed.
        """
        memory = load_memory(path, self._learned, self._nominal_map, self.kinematics.frames)
        self.recall(memory.map, memory.antagonism, memory.vision)
        self._commander.recall(memory.map, memory.posture)
        self.wiring.forget()
        ones = np.ones(len(self.map.muscles))
        self.in_use.recall(ones if memory.in_use is None else memory.in_use)
        self._in_use_changed()
        self.begin_episode()

    def zeroed(self) -> None:
        """Take note that all muscle lengths were zeroed anew, as after a power cycle.

        What was learned of the map's shape stays. The offsets of all lengths are open again, and
        the first marker observations determine them. Call it before the episode, after `load`.
        Without this call the agent detects a zeroing from the first marker observations of an
        episode, and names it as a fault of kind ``zeroed``.
        """
        self._schedule.reset()
        self.vision.zeroed()
        self.antagonism.forget()
        self._map_changed()
        self.estimator.reset(self.estimator.q)

    def _start(self, readings: SensorReadings) -> None:
        """Estimate where the arm is, and begin the trajectory there."""
        live = self.options.learning.enters_after == AS_SOON  # no step may take long
        self._arm.start(readings, live)
        self._commander.start(self.estimator.q, readings.time, readings.lengths)

    def _filtered(self, readings: SensorReadings, tick: Tick) -> SensorReadings:
        """The readings on the agent's own time, without those that the guard does not believe."""
        if tick.jump:
            self.guard.jump()
        angles = self.estimator.joint_encoders.checked(readings.joint_angles)
        frame_time = self._observer.exposed(tick.frame_time(readings.frame_time))
        readings = readings._replace(time=tick.time, frame_time=frame_time, joint_angles=angles)
        commander, expected, wiring = self._commander, self.estimator.lengths, self.wiring
        if self.motors is not None:
            wiring.watch(readings, expected, self.motors, self.in_use.mask)
        filtered = self.guard.filter(readings, commander.time, commander.target_lengths, expected)
        self.time_line.accept(tick)
        return self._arm.usable(readings, filtered)

    def _watch_robot(self, readings: SensorReadings) -> None:
        """Look for faults; unlearn what was learned just before a new one."""
        state = ArmState(
            self.estimator.q,
            self.estimator.jacobian,
            self.estimator.jacobian_at,
            len(self.vision.memory.observations),
            self.hand_is_free,
            self._observer.finder,
        )
        new = self.guard.watch(readings, state)
        self._schedule.take_back(readings.time, self.guard.take_back, new)
        if self.in_use.snapped(self.guard.faults, readings.time):
            self._in_use_changed()

    def _watch_limit(self, readings: SensorReadings, passed: float) -> None:
        """Stay where the arm is if a tension has been at its limit for long."""
        if self.motors is not None and self._tension_watch.update(readings, passed, self.motors):
            self._movement.stop(self.joint_angles, self._tension_watch.newest)

    def _watch_hand(self, readings: SensorReadings) -> None:
        """Estimate what the hand holds, and let the tensions hold it, too."""
        load, memory = self.hand_load, self.vision.memory
        if load is None or self._tensions is None:
            return
        if self.hand_is_free and load.rests:
            load.clear()
        elif not (self.hand_is_free or self.guard.faults) and memory.tensions_are_believed:
            lengths, tensions = readings.lengths, readings.tensions
            load.update(readings.time, lengths, tensions, self.estimator.q, memory.balanced_rests)
        self._tensions.loads = load.loads

    def _rewire(self) -> None:
        """Apply what is known of the wiring now."""
        commander, wiring = self._commander, self.wiring
        before, time = wiring.left_out, max(commander.time, 0.0)
        order = wiring.apply(self.vision.assignment, time)
        if order is None:
            return
        self._schedule.assignment = wiring.assignment
        if wiring.use(self.in_use, before, time):
            self._in_use_changed()
        if np.any(order != np.arange(len(order))):
            commander.reorder(order)
            angles = self.vision.memory.angles
            self.estimator.reset(angles[-1] if len(angles) else self.estimator.q)
        self.guard.jump()
        self._rests.restart()

    def _map_changed(self) -> None:
        """Pass a new map to all parts that use it."""
        self.estimator.set_map(self.map)
        self.estimator.spread = self._learned.spread
        self.guard.map_changed()
        self._observer.map_changed()
        if self.in_use.observed(self.vision.memory.shown):
            self._in_use_changed()

    def _in_use_changed(self) -> None:
        """Pass which muscles are in use to all parts that use it."""
        self.guard.leave_out(~self.in_use.mask)
        self._movement.in_use_changed()

    def _stiffness_changed(self) -> None:
        """Pass the stiffness of the motors to all parts that use it."""
        if self._stiffness.commanded is not None:
            self.guard.set_stiffness(self._stiffness.commanded)
        if self.heat is not None and self.motors is not None:
            self.heat.set_motors(self.motors)
