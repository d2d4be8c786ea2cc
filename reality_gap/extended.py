"""Extended model: a plant of its own, with the effects that MuJoCo cannot express beside it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import mujoco

from reality_gap.causes.base import Cause, Effects, Location
from reality_gap.errors import UnknownNameError
from reality_gap.simulation.hypothesis import Plant
from reality_gap.simulation.inverse_dynamics import ensure_prepared, inverse_replay
from reality_gap.simulation.replay import Replay, replay
from reality_gap.study.data import Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import compile_system, with_step


@dataclass(frozen=True)
class Effect:
    """A cause that acts in addition to the model.

    Attributes:
        cause: the mechanism.
        location: where it acts.
        values: values of its parameters in SI units.
    """

    cause: Cause
    location: Location
    values: dict[str, float]


@dataclass(frozen=True)
class Extended:
    """A model that was extended by causes.

    ``extended.spec.compile()`` is a `mujoco.MjModel`, and ``extended.spec.to_xml()`` its MJCF. What
    MuJoCo cannot express, as an offset of an encoder or a delay of commands, is in ``effects``.

    Attributes:
        spec: the model, as in extended.xml; must not be edited.
        effects: causes that act in addition to it.
    """

    spec: mujoco.MjSpec
    effects: tuple[Effect, ...]

    def plant(self, study: Study) -> Plant:
        """Return the extended plant for a study of the diagnosed model.

        Raises:
            UnknownNameError: an effect acts on an element that the study's model does not have.
        """
        nominal, effects = compile_system(study), Effects()
        step = self.spec.option.timestep / nominal.model.opt.timestep
        system = nominal if step == 1.0 else with_step(nominal, step)
        for effect in self.effects:
            _check_location(effect.location, study)
            if effect.cause.attach is not None:
                effect.cause.attach(effects, system, effect.location, effect.values)
        return Plant(self.spec.copy(), effects)

    def replay(self, study: Study) -> Replay:
        """Replay a study with the extended model.

        Replays begin again where the study states it; see `restart` in docs/reality_gap.md.

        Raises:
            UnknownNameError: see `plant`.
        """
        study = ensure_prepared(study)
        run = inverse_replay if study.inverse else replay
        return run(self.plant(study), study, measured(study))


def _check_location(location: Location, study: Study) -> None:
    known = list(names(location.kind, study.spec()))
    for name in location.elements:
        if location.kind != "model" and name not in known:
            raise UnknownNameError(f"{location.kind} of the study's model", name, known)


def names(kind: str, spec: mujoco.MjSpec) -> Iterable[str]:
    """Return the names of all elements of a kind, as of "body"."""
    plural = {"body": "bodies"}.get(kind, f"{kind}s")
    return (element.name for element in getattr(spec, plural, ()))
