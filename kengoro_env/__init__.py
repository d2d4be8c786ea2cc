"""Kengoro's arm as Gymnasium environments.

Importing this package registers ``Kengoro/CanGrasp-v0``, ``Kengoro/Posture-v0`` and
``Kengoro/Elbow-v0``, and chooses a GL library that needs no display; `KengoroEnv` documents actions
and observations. The public names below are imported when they are first used; ``__init__.pyi``
lists them.
"""

import gymnasium
import lazy_loader

from kengoro_env.vision import gl_backend

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

gl_backend.choose()

_ENTRY_POINT = "kengoro_env.env:KengoroEnv"
_VECTOR_ENTRY_POINT = "kengoro_env.vector:KengoroVectorEnv"

# Twice 4 approaches of 15 s and 60 postures of 4 s, so that there is time to observe and to settle.
# Only the camera shows where the can stands. A vector environment has none.
gymnasium.register(
    "Kengoro/CanGrasp-v0",
    _ENTRY_POINT,
    max_episode_steps=20_000,
    kwargs={"task": "can_grasp", "camera": None},
    vector_entry_point=_VECTOR_ENTRY_POINT,
)
# 5 targets of 4 s.
for _id, _task in (("Kengoro/Posture-v0", "posture"), ("Kengoro/Elbow-v0", "elbow")):
    gymnasium.register(
        _id,
        _ENTRY_POINT,
        max_episode_steps=1000,
        kwargs={"task": _task},
        vector_entry_point=_VECTOR_ENTRY_POINT,
    )
