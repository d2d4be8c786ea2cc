"""Nominal model of a robot in all the forms that an agent needs: lengths, kinematics, statics."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from pathlib import Path
from tempfile import TemporaryDirectory

from jmm_agent.guard.faults import MotorControl
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.nominal_model import NominalModel
from jmm_agent.options import AgentOptions
from jmm_agent.vision.camera import Camera
from kengoro.errors import UsageError
from kengoro.robots import CAMERA
from kengoro.trained_maps import Groups, model_of
from kengoro_env.robot.kinematic_tree import kinematic_tree
from kengoro_env.robot.model_file import is_asset
from kengoro_env.robot.motor_gains import gains_of
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.statics import Statics


class NominalRobot:
    """The robot in an MJCF file, as it is designed.

    Args:
        scene: MJCF file.
        folders: further folders whose files the model may include or load.
        groups: as in `nominal_model`.
        without: names of muscles that are left out.

    Attributes:
        arm: geometric model.
        model: nominal model for the agent.

    Raises:
        ModelError: the file cannot be used.
    """

    def __init__(
        self,
        scene: Path | str,
        folders: Sequence[Path | str] = (),
        groups: Groups | None = None,
        without: Sequence[str] = (),
    ) -> None:
        self._scene, self._folders = Path(scene), tuple(folders)
        self.arm = NominalArm(scene, folders, without)
        self.model: NominalModel = model_of(self.arm, groups)

    def kinematics(self, joints: Sequence[str], options: AgentOptions) -> ArmKinematics:
        """Kinematics, which must have the frames of the options; a camera only if they name one.

        Args:
            joints: names of the n joints, in the order of every q.
            options: name the frames of camera and marker.

        Raises:
            UsageError: the model has no such camera or site.
        """
        kinematics = self._kinematics(joints)
        wanted = [(options.marker_site, "site of the hand's marker", "marker_site")]
        if options.camera:
            wanted.insert(0, (options.camera, "camera", "camera"))
        for name, kind, option in wanted:
            if name not in kinematics.frames:
                known = ", ".join(kinematics.frames) or "none"
                raise UsageError(
                    f"The model {self._scene} has no {kind} {name!r}; name yours by "
                    f"AgentOptions({option}=...). Frames: {known}."
                )
        return kinematics

    def _kinematics(self, joints: Sequence[str]) -> ArmKinematics:
        if is_asset(self._scene):
            return ArmKinematics(self._scene, joints)
        with TemporaryDirectory() as folder:
            tree = Path(folder) / "tree.xml"
            tree.write_text(kinematic_tree(self.arm.model), encoding="utf-8")
            return ArmKinematics(tree, joints)

    def motors(self) -> MotorControl:
        """Gains and limit of the motors, from the file's actuators or from its load."""
        gains = gains_of(self._scene, self._folders).gains
        return MotorControl(gains.stiffness, gains.bias, gains.limit)

    def statics(self, motors: MotorControl) -> Statics:
        """Statics with these motors.

        Args:
            motors: least and largest tension.
        """
        gains = Gains(motors.stiffness, motors.bias, motors.limit)
        return Statics(self.arm, gains)

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the file's cameras."""
        model = self.arm.model
        return tuple(model.camera(number).name for number in range(model.ncam))

    def camera(self, name: str) -> Camera:
        """Model of a camera of the file; 640 x 480 pixels if the file has no resolution.

        Args:
            name: of the camera; `kengoro.robots.CAMERA` if the file has no such camera.
        """
        if name not in self.cameras:
            return CAMERA
        model, number = self.arm.model, self.cameras.index(name)
        width, height = (int(pixels) for pixels in model.cam_resolution[number])
        if min(width, height) < 2:
            width, height = CAMERA.width, CAMERA.height
        return Camera.from_fovy(width, height, radians(float(model.cam_fovy[number])))
