"""Presets: the nominal model, and actual robots by their seed."""

from __future__ import annotations

from math import radians

from kengoro_env.departures.camera import CameraError, FrameDelay
from kengoro_env.departures.geometry import AttachmentDisplacement, BoneWrapping
from kengoro_env.departures.sensors import EncoderError, TensionSensorError, ZeroPosture
from kengoro_env.departures.tendons import DryFriction, MotorInertia, TendonStretch
from kengoro_env.robot.draft import Departure


def drawing() -> tuple[Departure, ...]:
    """The nominal model: no departure."""
    return ()


def actual(seed: int) -> tuple[Departure, ...]:
    """An actual robot: the departures of the table in the docs; see `kengoro_env.departures`
    for those that it has not.

    Args:
        seed: seed of the random parts; seeds below 100 are for tuning, others for reports.
    """
    return (
        AttachmentDisplacement(sigma=0.004, seed=seed),
        BoneWrapping(scale=1.0),
        TendonStretch(compliance=1 / 100_000, hardening=4e6),
        MotorInertia(inertia=1.0),
        DryFriction(constant=1.0, ratio=0.02),
        EncoderError(offset=0.001, noise=0.0001, quantum=0.00005, seed=seed),
        TensionSensorError(noise=1.0, offset=1.0, seed=seed),
        ZeroPosture(
            shoulder=radians(18.0),
            scapula=radians(9.0),
            forearm=radians(8.0),
            neck=radians(3.0),
            seed=seed,
        ),
        CameraError(focal=0.003, position=0.002, rotation=radians(0.3), seed=seed),
        FrameDelay(delay=0.1),
    )
