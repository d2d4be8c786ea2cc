"""Pinhole camera model of the agent."""

from dataclasses import dataclass

import numpy as np

from jmm_agent.errors import AgentError


@dataclass(frozen=True)
class Camera:
    """Pinhole camera without distortion: square pixels, axes x right, y down, z forward (OpenCV).

    Attributes:
        width: of the frame [px].
        height: of the frame [px].
        focal_px: focal length [px], the same along x and y.

    Raises:
        AgentError: a size is below 1 px, or the focal length is not positive and finite.
    """

    width: int
    height: int
    focal_px: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise AgentError(
                f"A camera of {self.width} x {self.height} px has no pixels; sizes start at 1."
            )
        if not (np.isfinite(self.focal_px) and self.focal_px > 0):
            raise AgentError(
                f"The camera's focal length is {self.focal_px} px; it must be positive and finite."
            )

    @classmethod
    def from_fovy(cls, width: int, height: int, fovy_rad: float) -> "Camera":
        """Camera with a vertical field of view.

        Args:
            width: of the frame [px].
            height: of the frame [px].
            fovy_rad: angle between the upper and the lower border of the frame [rad].

        Raises:
            AgentError: the angle is not between 0 and pi, or a size is below 1 px.
        """
        if not 0 < fovy_rad < np.pi:
            raise AgentError(
                f"The camera's vertical view is {fovy_rad} rad; it must lie between 0 and pi."
            )
        return cls(width, height, float(height / 2 / np.tan(fovy_rad / 2)))

    @property
    def matrix(self) -> np.ndarray:
        """Intrinsic matrix (3, 3) [px]; the centres of pixels are at integers."""
        return np.array(
            [
                [self.focal_px, 0.0, (self.width - 1) / 2],
                [0.0, self.focal_px, (self.height - 1) / 2],
                [0.0, 0.0, 1.0],
            ]
        )
