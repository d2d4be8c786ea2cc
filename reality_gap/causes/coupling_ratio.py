"""Coupling ratio: a joint moves with another by another ratio than in the model.

The nominal model couples the joints by an equality constraint, as in fingers whose last joint
follows the one before it, or by a fixed tendon that pulls several joints.
"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support.tendon_paths import scale_coefficient
from reality_gap.study.system import System

WITH = "with "
"""First word of the note of a location; the name of the other joint, or of the joint of a tendon,
follows."""


def _locations(system: System) -> tuple[Location, ...]:
    equalities = (Location("joint", (one,), WITH + other) for one, other in _equalities(system))
    return (*equalities, *_fixed_tendons(system))


def _equalities(system: System) -> Iterator[tuple[str, str]]:
    """Yield the names of the joints of each equality that couples two joints by a ratio."""
    model = system.model
    for e in np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)):
        if model.eq_obj2id[e] >= 0 and model.eq_data[e, 1] and model.eq_active0[e]:
            ids = (int(model.eq_obj1id[e]), int(model.eq_obj2id[e]))
            yield model.joint(ids[0]).name, model.joint(ids[1]).name


def _fixed_tendons(system: System) -> Iterator[Location]:
    """Yield each joint of a fixed tendon but the first, to which the ratios refer."""
    model, joint = system.model, int(mujoco.mjtWrap.mjWRAP_JOINT)
    for t in range(model.ntendon):
        first, count = int(model.tendon_adr[t]), int(model.tendon_num[t])
        if int(model.wrap_type[first]) != joint or not model.tendon(t).name:
            continue
        for w in range(first + 1, first + count):
            name = model.joint(int(model.wrap_objid[w])).name
            if model.wrap_prm[w] and name:
                yield Location("tendon", (model.tendon(t).name,), WITH + name)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("excess", "1", 0.05, 0.001, -1.0, 3.0),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if not values["excess"]:
        return
    factor, [name], other = 1 + values["excess"], location.elements, location.note[len(WITH) :]
    if location.kind == "tendon":
        scale_coefficient(spec, name, other, factor)
        return
    for one in spec.equalities:
        if one.type == mujoco.mjtEq.mjEQ_JOINT and (one.name1, one.name2) == (name, other):
            data = np.array(one.data)
            data[1] *= factor
            one.data = data


CAUSE = Cause(
    id="coupling_ratio",
    title="wrong ratio of a coupling",
    explanation="A joint moves with another one, but by another ratio than in the model.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
