"""What was measured while each muscle was pulled."""

from __future__ import annotations

from dataclasses import dataclass

from jmm_agent.guard.faults import MotorControl
from jmm_agent.types import Bools, Floats


@dataclass(frozen=True, eq=False)
class PullRecord:
    """Responses of m muscles; row k of a matrix is muscle k while muscle i, the column, is pulled.

    Attributes:
        muscles: names of the muscles.
        strokes: by how much each command was shortened (m,) [m]; 0: the muscle was not pulled;
            negative: it was lengthened, because its tension falls when it is shortened.
        lengths: changes of the measured lengths (m, m) [m].
        tensions: changes of the measured tensions (m, m) [N].
        length_noise: standard deviation of a mean length (m,) [m].
        tension_noise: standard deviation of a mean tension (m,) [N].
        rest_lengths: before the first pull (m,) [m].
        rest_tensions: before the first pull (m,) [N].
        taken_up: by how much a muscle that was slack at rest was shortened until it pulled
            (m,) [m]; infinite if it did not, NaN for a muscle that was not slack.
        ended: muscles whose pull ended early, at the limit of the tension (m,).
        released: by how much a muscle was released at rest, because it pulled too much (m,) [m].
        largest_tension: of all readings [N] that are no more than the motors can pull.
        largest_change: largest change of a length at rest by a pull [m], of another muscle.
        duration: of the run, by its time stamps [s].
        travel: how far the muscles move between the joint limits [m].
        motors: gains and limit.
        before: tension of each muscle before each pull (m, m) [N].
        running: muscles whose reading ran away while their command stayed (m,).
        first_lengths: first readings (m,) [m].
    """

    muscles: tuple[str, ...]
    strokes: Floats
    lengths: Floats
    tensions: Floats
    length_noise: Floats
    tension_noise: Floats
    rest_lengths: Floats
    rest_tensions: Floats
    taken_up: Floats
    ended: Bools
    released: Floats
    largest_tension: float
    largest_change: float
    duration: float
    travel: float
    motors: MotorControl
    before: Floats
    running: Bools
    first_lengths: Floats
