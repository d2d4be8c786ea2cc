"""`kengoro demo`: one robot misses a can, learns from what it sees of its hand, and grasps it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich import get_console

from jmm_agent.updaters.vision_options import HandKind
from jmm_agent.vision.can_shape import CanKind
from kengoro.agents import make_agent
from kengoro.grasp_trial import Trial, begin_trial, outcome_sentences
from kengoro.robots import make_env, shuffled_postures
from kengoro.trained_maps import trained_map
from kengoro.viewer.progress import film_and_progress, stage_bar
from kengoro.viewer.video import open_video


@dataclass(frozen=True)
class Args:
    """One robot misses a can, learns from what it sees of its hand, and grasps the can.

    Attributes:
        robot: seed of the actual robot.
        hand: whether the hand carries a marker ("marker"), or is seen without one ("seen").
        can: whether the can carries a marker ("marker"), or is seen without one ("seen").
        detector: file of `kengoro hand-detector` that sees the hand; Kengoro's own if left out.
        out: folder of the film.
    """

    robot: int = 100
    hand: HandKind = "marker"
    can: CanKind = "marker"
    detector: Path | None = None
    out: Path = Path("out/demo")


def main(args: Args) -> None:
    """Run the trial, film it, and print what happened."""
    console = get_console()
    kind: HandKind = "seen" if args.detector else args.hand
    with console.status("Training the map of the nominal model (half a minute, once) ..."):
        trained_map()
    agent = make_agent(args.robot, hand=args.detector or args.hand, can=args.can)
    film = args.out / "episode.mp4"
    env = make_env("CanGrasp", args.robot, hand=kind, can=args.can, render_mode="rgb_array")
    with stage_bar("Kengoro") as progress, open_video(film) as video:
        watch = film_and_progress(video, progress)
        postures = shuffled_postures(args.robot)
        trial = begin_trial(env, agent, args.robot, postures, watch=watch)
        result = trial.run_to_end()
    env.close()
    sentences = [
        *trial_sentences(result, agent.vision.fired),
        agent.predictions.sentence,
        *result.notes,
    ]
    console.print(" ".join(filter(None, sentences)))
    console.print(f"Film: {film}")


def trial_sentences(trial: Trial, observations: int) -> list[str]:
    """Result of a trial in three sentences; see `outcome_sentences`."""
    approaches = trial.approaches
    return outcome_sentences(
        [approach.distance for approach in approaches],
        [approach.grasped for approach in approaches],
        observations,
        approaches[-1].start - approaches[0].start if approaches else 0.0,
    )
