"""Kengoro's arm as Gymnasium environments.

Importing this package registers ``Kengoro/CanGrasp-v0``, ``Kengoro/Posture-v0`` and
``Kengoro/Elbow-v0``, and lets MuJoCo draw without a display; `kengoro_env.env.KengoroEnv` says
what they take and give.
"""

import gymnasium

from kengoro_env.vision import gl_backend

gl_backend.choose()

_ENTRY_POINT = "kengoro_env.env:KengoroEnv"
_MANY = "kengoro_env.vector:KengoroVectorEnv"

# 4 approaches of 15 s and 60 postures of 4 s, and as much again to look and to settle.
gymnasium.register(
    "Kengoro/CanGrasp-v0", _ENTRY_POINT, max_episode_steps=20_000, kwargs={"task": "can_grasp"}
)
# 5 targets of 4 s.
for _id, _task in (("Kengoro/Posture-v0", "posture"), ("Kengoro/Elbow-v0", "elbow")):
    gymnasium.register(
        _id,
        _ENTRY_POINT,
        max_episode_steps=1000,
        kwargs={"task": _task},
        vector_entry_point=_MANY,
    )
