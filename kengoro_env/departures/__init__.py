"""Departures: how an actual robot differs from its nominal model.

A departure is a frozen dataclass with one method, ``edit(draft)``, which writes the departure into
a `Draft`, a robot that is not compiled yet. The defaults of its parameters are null: they leave the
draft, and so the compiled model, unchanged. The agent never gets to know the departures.

To add a departure, write one file in this folder, for example ``joint_friction.py``:

```python
@dataclass(frozen=True)
class JointFriction:
    torque: float = 0.0  # friction torque of every joint [N m]

    def edit(self, draft: Draft) -> None:
        if self.torque == 0.0:
            return
        for joint in draft.spec.joints:
            joint.frictionloss = self.torque
```

``make_env(..., departures=[JointFriction(0.1)])`` takes it as it is. To publish it, import it below
and list it in ``__all__``. A test then asks for a line in ``CASES`` of
``tests/kengoro_env/departures/test_departures.py``, and checks that null parameters change no bit
of the model and that small ones change the motion little.

Edits set values; they do not scale values that they read, so that edits do not compound. A
departure with random parts takes a ``seed`` and samples from ``default_rng([seed, number])``, with
a number that no other departure has. To make a departure part of every ``actual(seed)``, add it to
``presets.py``; this changes all results.
"""

from kengoro_env.departures.bodies import BoneError, MarkerError, NoCanMarker, NoHandMarker
from kengoro_env.departures.camera import (
    CameraError,
    FrameDelay,
    FrameTimeError,
    LensDistortion,
)
from kengoro_env.departures.geometry import AttachmentDisplacement, BoneWrapping
from kengoro_env.departures.heat import HeatingMotors
from kengoro_env.departures.payload import Payload
from kengoro_env.departures.presets import actual, drawing
from kengoro_env.departures.sensors import EncoderError, TensionSensorError, ZeroPosture
from kengoro_env.departures.tendons import DryFriction, Elongation, MotorInertia, TendonStretch

__all__ = [
    "AttachmentDisplacement",
    "BoneError",
    "BoneWrapping",
    "CameraError",
    "DryFriction",
    "Elongation",
    "EncoderError",
    "FrameDelay",
    "FrameTimeError",
    "HeatingMotors",
    "LensDistortion",
    "MarkerError",
    "MotorInertia",
    "NoCanMarker",
    "NoHandMarker",
    "Payload",
    "TendonStretch",
    "TensionSensorError",
    "ZeroPosture",
    "actual",
    "drawing",
]
