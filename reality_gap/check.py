"""Check: warnings on suspicious studies, each in one sentence with advice."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from reality_gap.causes import CATALOGUE
from reality_gap.io.plausibility import scale_warnings
from reality_gap.io.validation import actuator_names
from reality_gap.simulation.expectation import implausible_channels
from reality_gap.simulation.inverse_dynamics import ensure_prepared, left_out
from reality_gap.simulation.replay_warnings import replay_warnings
from reality_gap.study.data import Episode, Study
from reality_gap.study.measurements import channel_noise
from reality_gap.study.restarts import position_channels
from reality_gap.study.system import command_limits, commanded, compile_system
from reality_gap.types import Floats

QUIET = 3.0
"""Ratio of a channel's standard deviation to its noise below which it hardly moves."""

WRONG_NOISE = 20.0
"""Ratio of the stated to the estimated noise, or the inverse, above which it is wrong."""

FEW = 20
"""Number of readings of a channel over all episodes below which they are too few."""

COARSE = 8
"""Number of different values of a channel below which its sensor is coarse."""

BEYOND = 0.05
"""Distance from a joint's range, over the range, from which on a position is outside it."""

NEEDS_MOTION = ("coulomb_friction", "viscous_friction", "direction_dependent_friction", "backlash")
"""Ids of causes that show in motion only."""


def check_study(study: Study) -> tuple[str, ...]:
    """Return warnings to consider before a diagnosis; empty if nothing is suspicious."""
    prepared = ensure_prepared(study)
    return (
        *(warning.sentence for warning in scale_warnings(study)),
        *_clocks(study),
        *_copies(study),
        *_commands(study),
        *_channels(study),
        *_noise(study),
        *_quiet(study),
        *_beginnings(study),
        *_beyond_stops(study),
        *_left_out_efforts(study, prepared),
        *implausible_channels(study),
        *replay_warnings(prepared),
    )


def causes_without_location(study: Study) -> tuple[str, ...]:
    """Return the ids of the causes that have no element in this model and log to act on."""
    system = compile_system(study)
    return tuple(cause.id for cause in CATALOGUE.values() if not cause.locations(system))


def summary(study: Study) -> str:
    """Return the size of a study, such as "3 episodes, 20 s, 9 channels, 18000 readings"."""
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
                f"{episode.name}: readings continue until {episode.duration:.3g} s, but commands "
                f"end at {end:.3g} s; the last command is held"
            )
        found += [
            f"{episode.name}: no rows between {begin:.3g} and {stop:.3g} s; if the recording was "
            "stopped there, split it into two episodes"
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
                f"{one.name} and {other.name} have the same readings, so that one cannot test "
                "what is fitted to the other; remove one of them"
            )
    values = [_values(study, i) for i in range(len(study.channels))]
    for i, j in combinations(range(len(values)), 2):
        if np.array_equal(values[i], values[j]) and np.ptp(values[i]) > 0.0:
            names = f"{study.channels[i].name} and {study.channels[j].name}"
            found.append(f"{names} have the same values; check their columns")
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
    for i, (name, actuator) in enumerate(zip(names, commanded(model), strict=True)):
        low, high = command_limits(model, actuator)
        outside = np.mean((commands[:, i] < low) | (commands[:, i] > high))
        if outside > 0.0:
            found.append(
                f"the command of {name} exceeds the model's ctrlrange ({low:.3g} to {high:.3g}) in "
                f"{100.0 * outside:.3g} % of the rows, where the model clips it"
            )
        if all(np.ptp(episode.command[:, i]) == 0.0 for episode in study.episodes):
            still.append(name)
    if model.nu and len(still) == model.nu:
        found.append("no command ever changes; a log with motion contains more information")
    elif still:
        found.append(f"the command of {', '.join(still)} never changes")
    reverses = False
    for episode in study.episodes:
        steps = np.sign(np.diff(episode.command, axis=0))
        reverses = reverses or any(1.0 in column and -1.0 in column for column in steps.T)
    if model.nu > len(still) and not reverses:
        found.append(
            "no command reverses its direction, so that friction and backlash can hardly be "
            "distinguished"
        )
    return found


def _channels(study: Study) -> list[str]:
    found = []
    for i, channel in enumerate(study.channels):
        values = _values(study, i)
        different = len(np.unique(values))
        if len(values) < FEW:
            found.append(f"{channel.name} has only {len(values)} readings")
        elif different == 1:
            advice = "" if channel.noise else "; its noise cannot be estimated, so state it"
            found.append(f"{channel.name} never changes{advice}")
        elif different < COARSE:
            found.append(f"{channel.name} has only {different} different values: a coarse sensor")
        for episode in study.episodes:
            reading = episode.readings[i].value
            if different > 1 and len(reading) >= FEW and np.ptp(reading) == 0.0:
                found.append(
                    f"{channel.name} is constant in {episode.name}, but not in other episodes; "
                    "check that it was connected"
                )
    return found


def _noise(study: Study) -> list[str]:
    """Warn of a stated noise that differs so much from the log that its unit may be wrong."""
    large, small = [], []
    estimated, thinned = _estimated_noise(study, 1), _estimated_noise(study, 2)
    for i, (channel, fine, rough) in enumerate(
        zip(study.channels, estimated, thinned, strict=True)
    ):
        # The steps of a coarse sensor hide its noise.
        if channel.noise is None or fine <= 1e-5 * float(np.ptp(_values(study, i))):
            continue
        text = (
            f"the noise of {channel.name} is stated as {channel.noise:.2g} {channel.unit}, but the "
            f"log shows about {fine:.2g} {channel.unit}"
        )
        if channel.noise > WRONG_NOISE * fine:
            large.append(text)
        # If the differences come from motion, they grow with the time between readings.
        elif fine > WRONG_NOISE * channel.noise and rough < 2.0 * fine:
            small.append(text)
    found = []
    for texts, advice in (
        (large, "check that it is in the unit of its line and that the log was not filtered"),
        (small, "check that it is in the unit of its line"),
    ):
        more = f" (similar for {len(texts) - 1} more)" if len(texts) > 1 else ""
        found += [f"{text}{more}; {advice}" for text in texts[:1]]
    return found


def _estimated_noise(study: Study, stride: int) -> Floats:
    """Return the noise of each channel as estimated from every reading or every second one."""
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
    """Warn of sensors none of whose components moves by more than its noise."""
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
            "too quiet: no channel moves by more than its noise, so this log can show offsets at "
            f"most, but not {', '.join(NEEDS_MOTION)} or any other cause that shows in motion"
        ]
    return [
        f"{name} hardly moves ({text}); causes that show in this sensor alone cannot be judged"
        for name, text in quiet.items()
    ]


def _left_out_efforts(study: Study, prepared: Study) -> list[str]:
    """Warn of efforts that are not compared."""
    return [
        f"the {name} is not compared, because its joint hardly moves"
        for name in left_out(study, prepared)
    ]


def _beyond_stops(study: Study) -> list[str]:
    """Warn of joints that were measured where the model's stop pushes them back."""
    model, found = study.spec().compile(), []
    for name, channel in position_channels(study, model).items():
        joint, values = model.joint(name).id, _values(study, channel)
        low, high = model.jnt_range[joint]
        if not model.jnt_limited[joint] or not len(values):
            continue
        far = max(values.max() - high, low - values.min())
        if far > BEYOND * (high - low):
            found.append(
                f"{name} is measured up to {far:.3g} beyond its range in the model, {low:.3g} to "
                f"{high:.3g}, where the model has a stop; widen the range if the machine has none"
            )
    return found


def _beginnings(study: Study) -> list[str]:
    """Warn of initial joint positions that contradict the joint's range or its first reading."""
    model = study.spec().compile()
    read, found = position_channels(study, model), []
    for episode in study.episodes:
        for name, position in {**study.initial.joints, **episode.joints}.items():
            joint = model.joint(name)
            low, high = model.jnt_range[joint.id]
            slack = BEYOND * (high - low)
            if model.jnt_limited[joint.id] and not low - slack <= position <= high + slack:
                found.append(
                    f"{episode.name} begins with {name} at {position:.3g}, outside its range in "
                    f"the model, {low:.3g} to {high:.3g}"
                )
            if name in read and len(episode.readings[read[name]].value) > 1:
                values = episode.readings[read[name]].value
                if abs(values[0] - position) > max(0.5 * float(np.ptp(values)), 1e-3):
                    found.append(
                        f"{episode.name} begins with {name} at {position:.3g}, but its first "
                        f"reading is {values[0]:.3g}; 'joints: first_reading' uses the reading"
                    )
    return found
