"""Made-up LeRobotDatasets in the layouts of public sets."""

import json
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

FPS = 30
POSE = ["x", "y", "z", "qw", "qx", "qy", "qz"]


def write_set(folder, episodes, names, version="v3.0", fps=FPS, per_file=2, **changes):
    """A set of episodes, each a dict of (T, D) by feature, in a folder, which is returned.

    `names`: of columns, as in the description; `per_file`: episodes in a file of v3.0; `changes` replace
    keys of the description.
    """
    lengths = [len(next(iter(episode.values()))) for episode in episodes]
    starts = np.concatenate([[0], np.cumsum(lengths)])
    features = {
        name: {"dtype": "float32", "shape": [episodes[0][name].shape[1]], "names": names.get(name)}
        for name in episodes[0]
    }
    features["observation.images.top"] = {"dtype": "video", "shape": [3, 8, 8], "names": ["c", "h", "w"]}
    for counter in ("timestamp", "frame_index", "episode_index", "index", "task_index"):
        features[counter] = {"dtype": "int64", "shape": [1], "names": None}
    modern = version.startswith("v3")
    info = {
        "codebase_version": version,
        "robot_type": "so101_follower",
        "total_episodes": len(episodes),
        "total_frames": int(starts[-1]),
        "chunks_size": 1000,
        "fps": fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
        if modern
        else "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "features": features,
    } | changes
    (folder / "meta").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info))
    tables = [_frames(number, episode, int(starts[number]), fps) for number, episode in enumerate(episodes)]
    if modern:
        for file in range(0, len(tables), per_file):
            path = folder / f"data/chunk-000/file-{file // per_file:03d}.parquet"
            _write(pa.concat_tables(tables[file : file + per_file]), path)
        rows = {
            "episode_index": list(range(len(episodes))),
            "length": lengths,
            "data/chunk_index": [0] * len(episodes),
            "data/file_index": [number // per_file for number in range(len(episodes))],
            "dataset_from_index": starts[:-1].tolist(),
            "dataset_to_index": starts[1:].tolist(),
        }
        _write(pa.table(rows), folder / "meta/episodes/chunk-000/file-000.parquet")
    else:
        for number, table in enumerate(tables):
            _write(table, folder / f"data/chunk-000/episode_{number:06d}.parquet")
        lines = [
            json.dumps({"episode_index": number, "tasks": ["pour"], "length": length})
            for number, length in enumerate(lengths)
        ]
        (folder / "meta/episodes.jsonl").write_text("\n".join(lines) + "\n")
    return folder


def edited(name, change):
    """Change of a set: a table is written anew; `change` takes and returns a data frame."""

    def edit(folder):
        table = change(pq.read_table(folder / name).to_pandas())
        _write(pa.Table.from_pandas(table, preserve_index=False), folder / name)

    return edit


def described(**changes):
    """Change of a set: other values in its description."""

    def describe(folder):
        path = folder / "meta/info.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | changes))

    return describe


def unlisted(folder):
    """Change of a set: without its list of episodes."""
    shutil.rmtree(folder / "meta/episodes")


def lost(name):
    """Change of a set: without a file."""
    return lambda folder: (folder / name).unlink()


def copied(name, other):
    """Change of a set: a file once more, under another name."""
    return lambda folder: shutil.copy(folder / name, folder / other)


def _frames(number, episode, start, fps):
    count = len(next(iter(episode.values())))
    columns = {name: pa.array(values.tolist(), pa.list_(pa.float32())) for name, values in episode.items()}
    columns |= {"timestamp": pa.array(np.arange(count) / fps, pa.float32())}
    columns |= {"frame_index": range(count), "episode_index": [number] * count}
    return pa.table(columns | {"index": range(start, start + count), "task_index": [0] * count})


def _write(table, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)
