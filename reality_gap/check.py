"""What is suspicious in a study that can be read: sentences, each with advice."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import mujoco
import numpy as np

from reality_gap.causes import CATALOGUE
from reality_gap.io.plausibility import doubts
from reality_gap.io.validation import actuator_names
from reality_gap.simulation.expectation import surprises
from reality_gap.study.data import Episode, Study
from reality_gap.study.measurements import channel_noise
from reality_gap.study.system import look_at
from reality_gap.types import Floats

QUIET = 3.0
"""A channel whose standard deviation is below so many times its noise hardly moves."""

WRONG_NOISE = 20.0
"""How many times off a noise must be to be called wrong."""

FEW = 20
"""Readings of a channel over all episodes that are called few."""

COARSE = 8
"""Different values of a channel that are called few."""

MOVING = ("coulomb_friction", "viscous_friction", "direction_dependent_friction", "backlash")
"""Causes that show in motion only."""


def check_study(study: Study) -> tuple[str, ...]:
    """What a person should look at before a diagnosis; empty if nothing is suspicious."""
    units = tuple(doubt.sentence for doubt in doubts(study))
    return (
        *units,
        *_clocks(study),
        *_copies(study),
        *_commands(study),
        *_channels(study),
        *_noise(study),
        *_quiet(study),
        *_beginnings(study),
        *surprises(study),
    )


def unjudged(study: Study) -> tuple[str, ...]:
    """Ids of the causes that have nothing in this model and these channels to act on."""
    system = look_at(study)
    return tuple(cause.id for cause in CATALOGUE.values() if not cause.locations(system))


def summary(study: Study) -> str:
    """How much there is: "3 episodes, 20 s, 9 channels, 18000 readings"."""
    readings = sum(len(r.time) for episode in study.episodes for r in episode.readings)
    counts = [
        f"{count} {noun}{'s' * (count != 1)}"
        for count, noun in (
            (len(study.episodes), "episode"),
            (len(study.channels), "channel"),
            (readings, "reading"),
        )
    ]
    return ", ".join([counts[0], f"{study.duration:.3g} s", *counts[1:]])


def _values(study: Study, channel: int) -> Floats:
    return np.concatenate([episode.readings[channel].value for episode in study.episodes])


def _clocks(study: Study) -> list[str]:
    found = []
    for episode in study.episodes:
        end = float(episode.time[-1])
        if len(episode.time) > 1 and episode.duration > end + max(1.0, 0.5 * end):
            found.append(
                f"{episode.name}: readings go on to {episode.duration:.3g} s, but commands end at "
                f"{end:.3g} s; the last one is held"
            )
        found += [
            f"{episode.name}: no rows between {begin:.3g} and {stop:.3g} s; if the machine was "
            "stopped there, make it two episodes"
            for begin, stop in _gaps(episode.time)[:3]
        ]
    return found


def _gaps(time: Floats) -> list[tuple[float, float]]:
    steps = np.diff(time)
    if len(steps) < FEW:
        return []
    wide = np.flatnonzero(steps > max(10.0 * float(np.median(steps)), 0.1))
    return [(float(time[i]), float(time[i + 1])) for i in wide]


def _copies(study: Study) -> list[str]:
    found = []
    for one, other in combinations(study.episodes, 2):
        if _same(one, other):
            found.append(
                f"{one.name} and {other.name} hold the same readings, so that neither tests what "
                "is learned from the other; remove one"
            )
    values = [_values(study, i) for i in range(len(study.channels))]
    for i, j in combinations(range(len(values)), 2):
        if np.array_equal(values[i], values[j]) and np.ptp(values[i]) > 0.0:
            names = f"{study.channels[i].name} and {study.channels[j].name}"
            found.append(f"{names} hold the same numbers; is one the wrong column?")
    return found


def _same(one: Episode, other: Episode) -> bool:
    pairs = zip(one.readings, other.readings, strict=True)
    return all(np.array_equal(a.value, b.value) for a, b in pairs)


def _commands(study: Study) -> list[str]:
    if study.inverse:
        return []
    model = study.spec().compile()
    found, still = [], []
    commands = np.concatenate([episode.command for episode in study.episodes])
    names = actuator_names(model)
    for i, (name, (low, high)) in enumerate(zip(names, model.actuator_ctrlrange, strict=True)):
        outside = np.mean((commands[:, i] < low) | (commands[:, i] > high))
        if model.actuator_ctrllimited[i] and outside > 0.0:
            found.append(
                f"the command of {name} leaves the model's ctrlrange ({low:.3g} to {high:.3g}) in "
                f"{100.0 * outside:.3g} % of the rows, where the model cuts it"
            )
        if all(np.ptp(episode.command[:, i]) == 0.0 for episode in study.episodes):
            still.append(name)
    if model.nu and len(still) == model.nu:
        found.append("no command ever changes; what moves the machine tells most about it")
    elif still:
        found.append(f"the command of {', '.join(still)} never changes")
    turns = False
    for episode in study.episodes:
        steps = np.sign(np.diff(episode.command, axis=0))
        turns = turns or any(1.0 in column and -1.0 in column for column in steps.T)
    if model.nu > len(still) and not turns:
        found.append("no command turns back, so friction and backlash can hardly be told apart")
    return found


def _channels(study: Study) -> list[str]:
    found = []
    for i, channel in enumerate(study.channels):
        values = _values(study, i)
        different = len(np.unique(values))
        if len(values) < FEW:
            found.append(f"{channel.name} has only {len(values)} readings")
        elif different == 1:
            advice = "" if channel.noise else "; its noise cannot be estimated, so give it"
            found.append(f"{channel.name} never changes{advice}")
        elif different < COARSE:
            found.append(f"{channel.name} takes only {different} different values: a coarse sensor")
        for episode in study.episodes:
            reading = episode.readings[i].value
            if different > 1 and len(reading) >= FEW and np.ptp(reading) == 0.0:
                found.append(
                    f"{channel.name} reads the same throughout {episode.name}, but not elsewhere; "
                    "was it connected?"
                )
    return found


def _noise(study: Study) -> list[str]:
    """Noise that is given in another unit: a servo's own jerks may be called noise five times."""
    large, small = [], []
    shown, coarser = _shown_noise(study, 1), _shown_noise(study, 2)
    for i, (channel, fine, rough) in enumerate(zip(study.channels, shown, coarser, strict=True)):
        # Steps of a coarse sensor hide its noise.
        if channel.noise is None or fine <= 1e-5 * float(np.ptp(_values(study, i))):
            continue
        text = (
            f"the noise given for {channel.name} is {channel.noise:.2g} {channel.unit}, but the "
            f"log shows about {fine:.2g} {channel.unit}"
        )
        if channel.noise > WRONG_NOISE * fine:
            large.append(text)
        # Where motion, not noise, makes the differences, they grow with the time between them.
        elif fine > WRONG_NOISE * channel.noise and rough < 2.0 * fine:
            small.append(text)
    found = []
    for texts, question in (
        (large, "is it in the unit of its line, and was the log filtered?"),
        (small, "is it in the unit of its line?"),
    ):
        more = f" (and {len(texts) - 1} more channels alike)" if len(texts) > 1 else ""
        found += [f"{text}{more}; {question}" for text in texts[:1]]
    return found


def _shown_noise(study: Study, stride: int) -> Floats:
    """Noise by channel as the log shows it, from every reading or every second one."""
    thinned = tuple(
        replace(
            episode,
            readings=tuple(
                replace(r, time=r.time[::stride], value=r.value[::stride]) for r in episode.readings
            ),
        )
        for episode in study.episodes
    )
    silent = tuple(replace(channel, noise=None) for channel in study.channels)
    return channel_noise(replace(study, channels=silent, episodes=thinned))


def _quiet(study: Study) -> list[str]:
    """Sensors no component of which moves by more than its noise."""
    noise = channel_noise(study)
    loudest: dict[str, tuple[float, str]] = {}
    for i, channel in enumerate(study.channels):
        parts = [episode.readings[i].value for episode in study.episodes]
        moved = float(np.std(np.concatenate([p - p.mean() for p in parts if len(p)])))
        text = f"{moved:.2g} {channel.unit} against a noise of {noise[i]:.2g}"
        name = f"effort of {channel.sensor}" if channel.kind == "effort" else channel.sensor
        loudest[name] = max(loudest.get(name, (0.0, "")), (moved / noise[i], text))
    quiet = {name: text for name, (ratio, text) in loudest.items() if ratio < QUIET}
    if len(quiet) == len(loudest):
        return [
            "too quiet: no channel moves by more than its noise, so this log can tell of offsets "
            f"at most, and not of {', '.join(MOVING)} or any other cause that shows in motion"
        ]
    return [
        f"{name} hardly moves ({text}); what shows in it alone cannot be judged"
        for name, text in quiet.items()
    ]


def _beginnings(study: Study) -> list[str]:
    """Where the study says that joints begin, against their ranges and their first readings."""
    model = study.spec().compile()
    jointpos = int(mujoco.mjtSensor.mjSENS_JOINTPOS)
    read = {
        model.joint(int(model.sensor(channel.sensor).objid[0])).name: i
        for i, channel in enumerate(study.channels)
        if channel.kind == "sensor" and int(model.sensor(channel.sensor).type[0]) == jointpos
    }
    found = []
    for episode in study.episodes:
        for name, position in {**study.initial.joints, **episode.joints}.items():
            joint = model.joint(name)
            low, high = model.jnt_range[joint.id]
            slack = 0.05 * (high - low)
            if model.jnt_limited[joint.id] and not low - slack <= position <= high + slack:
                found.append(
                    f"{episode.name} begins with {name} at {position:.3g}, outside its range in "
                    f"the model ({low:.3g} to {high:.3g})"
                )
            if name in read and len(episode.readings[read[name]].value) > 1:
                values = episode.readings[read[name]].value
                if abs(values[0] - position) > max(0.5 * float(np.ptp(values)), 1e-3):
                    found.append(
                        f"{episode.name} begins with {name} at {position:.3g}, but its first "
                        f"reading is {values[0]:.3g}; joints: first_reading takes that"
                    )
    return found
