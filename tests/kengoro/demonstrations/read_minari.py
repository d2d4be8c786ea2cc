"""Print as JSON what Minari's own package reads; run by the interpreter of its environment."""

from __future__ import annotations

import json

import minari  # type: ignore[import-not-found]


def main() -> None:
    """Read each episode of the data set in ``MINARI_DATASETS_PATH``."""
    (name,) = minari.list_local_datasets()
    dataset = minari.load_dataset(name)
    episodes = list(dataset.iterate_episodes())
    print(
        json.dumps(
            {
                "name": name,
                "steps": [len(episode) for episode in episodes],
                "total": dataset.total_steps,
                "environment": dataset.env_spec.id,
                "within": [
                    all(
                        dataset.observation_space.contains(
                            {key: values[i] for key, values in episode.observations.items()}
                        )
                        for i in range(len(episode) + 1)
                    )
                    and all(dataset.action_space.contains(action) for action in episode.actions)
                    for episode in episodes
                ],
                "lengths": [episode.observations["lengths"].tolist() for episode in episodes],
                "actions": [episode.actions.tolist() for episode in episodes],
                "rewards": [episode.rewards.tolist() for episode in episodes],
                "terminations": [episode.terminations.tolist() for episode in episodes],
                "truncations": [episode.truncations.tolist() for episode in episodes],
                "can_pose": [episode.infos["can_pose"].tolist() for episode in episodes],
                "success": [episode.infos["success"].tolist() for episode in episodes],
                "metadata": list(dataset.storage.get_episode_metadata(range(len(episodes)))),
                "robots": dataset.storage.metadata["robots"],
            }
        )
    )


main()
