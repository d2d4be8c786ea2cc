"""Print as JSON what LeRobot's own package reads; run by the interpreter of its environment."""

from __future__ import annotations

import json
import sys

from lerobot.datasets.lerobot_dataset import LeRobotDataset  # type: ignore[import-not-found]

VIDEO = "observation.images.head"


def main(folder: str) -> None:
    """Read each row of the data set with its frame."""
    dataset = LeRobotDataset(
        "kengoro/can-grasp",
        root=folder,
        video_backend="pyav",
        delta_timestamps={"action": [0, 0.2]},
    )
    rows = [dataset[i] for i in range(len(dataset))]
    print(
        json.dumps(
            {
                "episodes": dataset.num_episodes,
                "fps": dataset.fps,
                "task": rows[0]["task"],
                "grey": [255 * float(row[VIDEO].mean()) for row in rows],
                "shape": list(rows[0][VIDEO].shape),
                "episode": [int(row["episode_index"]) for row in rows],
                "state": [row["observation.state"].tolist() for row in rows],
                "can": [row["observation.environment_state"].tolist() for row in rows],
                "action": [row["action"].tolist() for row in rows],
                "padded": [row["action_is_pad"].tolist() for row in rows],
                "reward": [float(row["next.reward"]) for row in rows],
                "done": [bool(row["next.done"]) for row in rows],
                "success": [bool(row["next.success"]) for row in rows],
                "pixel_mean": dataset.meta.stats[VIDEO]["mean"].ravel().tolist(),
            }
        )
    )


main(sys.argv[1])
