"""Assembly of an agent: what learns, and what knows the loads, made from the agent's options."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.hand_load import HandLoad
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.job import MapLearning
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Learner, RidgeRule, Rule
from jmm_agent.mapping.prior import MapPrior, PointWeights
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import AntagonismUpdater, VisionUpdater
from jmm_agent.vision.balance import Balance, Loads
from jmm_agent.vision.hand_error import HandPostures
from jmm_agent.vision.marker_residual import MarkerResidual


def map_learning(
    nominal_map: JointMuscleMap,
    kinematics: ArmKinematics,
    typical: Floats,
    rng: np.random.Generator,
    options: AgentOptions,
    rule: Rule | None,
    loads: Loads | None,
    points: PointWeights | None,
) -> MapLearning:
    """The map and both updaters.

    Args:
        nominal_map: the map that was trained on the nominal model.
        kinematics: of the same joints.
        typical: postures (N, n) [rad] that set the scale of the prior.
        rng: samples rehearsal pairs.
        options: of the agent.
        rule: how the map is moved by what is learned; None: the ridge rule.
        loads: torques that the nominal model needs to hold a posture; None if unknown.
        points: what displaced points of attachment do to the lengths; None if unknown.

    Raises:
        AgentError: kinematics and map have different joints, or a frame of the options is unknown.
    """
    _check_joints(kinematics, nominal_map)
    limits, site = kinematics.limits, options.marker_site
    prior = MapPrior(nominal_map, typical, options.prior, points)
    residual = MarkerResidual(kinematics, options.camera or None, site)
    learner = Learner(nominal_map, limits, rule or RidgeRule(prior), options.batch, rng)
    seeing = options.vision
    if seeing.lengths is None and options.feed_forward and loads is not None:
        seeing = replace(seeing, lengths="l")
    judged = HandPostures.among(typical, kinematics, site, _widest(options))
    vision = VisionUpdater(learner, prior, residual, limits, seeing, loads, judged)
    antagonism = AntagonismUpdater(learner, options.antagonism)
    return MapLearning(learner, antagonism, vision, options.learn_antagonism)


def hand_load(
    nominal_map: JointMuscleMap,
    kinematics: ArmKinematics,
    options: AgentOptions,
    loads: Loads | None,
) -> HandLoad | None:
    """Mass of what the hand holds, at the frame of the options; None if the loads are unknown.

    Args:
        nominal_map: the map that was trained on the nominal model.
        kinematics: of the same joints.
        options: of the agent.
        loads: torques that the nominal model needs to hold a posture; None if unknown.
    """
    if loads is None:
        return None
    frame = options.grip if options.grip in kinematics.frames else options.marker_site
    balance = Balance(nominal_map, loads, kinematics.limits, options.vision.balance)
    return HandLoad(loads, balance, kinematics, frame, options.settling)


def _widest(options: AgentOptions) -> float:
    """By how much a joint may rest off its target, standard deviation [rad]."""
    return options.prior.zero_posture or options.arrival


def _check_joints(kinematics: ArmKinematics, nominal_map: JointMuscleMap) -> None:
    if kinematics.joints != nominal_map.joints:
        raise AgentError(
            f"Agent: the kinematics' joints {kinematics.joints} are not the map's "
            f"{nominal_map.joints}."
        )
