"""Agents that know the nominal model of a robot: of Kengoro's arm, or of one's own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.guard.faults import MotorControl
from jmm_agent.guard.guard import Guard, GuardOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Rule
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hold_out import HoldOutOptions
from jmm_agent.vision.marker_detector import Detector, MarkerDetector
from kengoro.hand_search import READY
from kengoro.robots import CAMERA, SIDES, arm_scene, check_seed, sample_postures
from kengoro.trained_maps import trained_map
from kengoro_env.postures import posture_set
from kengoro_env.robot.muscle_law import DEFAULT_GAINS
from kengoro_env.robot.nominal_model import NominalArm

MOTORS = MotorControl(DEFAULT_GAINS.stiffness, DEFAULT_GAINS.bias, DEFAULT_GAINS.limit)


def make_agent(
    seed: int = 0,
    *,
    guard: bool = False,
    scene: Path | str | None = None,
    camera: Camera = CAMERA,
    marker_sides: Mapping[int, float] = SIDES,
    postures: Floats | None = None,
    start: Floats | None = None,
    jmm: JointMuscleMap | None = None,
    detector: Detector | None = None,
    options: AgentOptions | None = None,
    rule: Rule | None = None,
    learning: bool = True,
    cache: Path | None = None,
) -> Agent:
    """An agent that knows the nominal model of a robot, and nothing of the robot itself.

    Without arguments it is the agent of Kengoro's arm: its map is trained on the nominal model once
    (half a minute) and then read from the user's cache folder.

    Args:
        seed: of the rehearsal pairs that learning samples.
        guard: whether faults of the robot are named, not learned, and commands limited. Without
            ``options``, updates that make the map worse on held-out observations are undone, too.
        scene: MJCF file of another robot's nominal model; Kengoro's arm if left out.
        camera: the camera model that the agent uses.
        marker_sides: side of each marker [m] by its id in the dictionary.
        postures: typical postures, shape (N, n) [rad], which set the scale of the map's prior; the
            posture set for Kengoro's arm, samples within the joint ranges for another robot.
        start: joint angles at which the agent believes to start, shape (n,) [rad].
        jmm: the map to begin with; the trained map of the nominal model if left out.
        detector: finds markers in frames; a `MarkerDetector` if left out.
        options: of the agent.
        rule: how the map is moved by what is learned; the ridge rule if left out.
        learning: whether the agent learns; see `Agent.learning`.
        cache: folder of trained maps; the user's cache folder if left out.

    Raises:
        UsageError: the seed is negative.
        AgentError: the options do not fit the robot.
    """
    check_seed(seed)
    path = arm_scene() if scene is None else Path(scene)
    if jmm is None:
        jmm = trained_map(cache, scene=None if scene is None else path)
    if postures is None:
        postures = posture_set() if scene is None else sample_postures(path, 100)
    if start is None:
        start = np.array(READY) if scene is None else postures[0]
    if guard and options is None:
        options = AgentOptions(vision=VisionOptions(hold_out=HoldOutOptions()))
    kinematics = ArmKinematics(path, jmm.joints)
    detector = detector or MarkerDetector(camera, marker_sides)
    rng = np.random.default_rng([seed, 2])
    agent = Agent(jmm, kinematics, detector, postures, start, rng, options, rule)
    if guard:
        agent.guard = _make_guard(agent, path, camera)
    agent.learning = learning
    return agent


def _make_guard(agent: Agent, scene: Path, camera: Camera) -> Guard:
    """Guard of an agent; disturbances act on the marker where the model has no frame of a grip."""
    kinematics, grip = agent.kinematics, GuardOptions().hand
    frame = grip if grip in kinematics.frames else agent.options.marker_site
    gravity, options = NominalArm(scene).gravity, GuardOptions(hand=frame)
    return Guard(agent.map.muscles, kinematics, camera, gravity, MOTORS, options)
