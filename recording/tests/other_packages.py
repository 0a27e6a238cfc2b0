"""Writes one motion with other packages, in their formats, to the folder in the argument.

Formats with joint names have the order elbow, shoulder, wrist: q = sin(k t), tau = k cos(k t) for k = 1, 2, 3 of shoulder, elbow, wrist.
"""

import json
import sys
from pathlib import Path

import numpy
import pandas
import scipy.io
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
from rosbags.typesys import Stores, get_typestore

out = Path(sys.argv[1])
names = ["elbow_joint", "shoulder_pan_joint", "wrist_1_joint"]
factors = numpy.array([2.0, 1.0, 3.0])
t = numpy.arange(400) * 0.01
q = numpy.sin(t[:, None] * factors)
tau = factors * numpy.cos(t[:, None] * factors)

# NumPy: time along the first or the second index.
numpy.savez(out / "plain.npz", t=t, q=q, tau=tau, joint_names=numpy.array(names))
numpy.savez_compressed(out / "deflated.npz", time=t, position=q.T, effort=tau.T, names=numpy.array(names))

# SciPy: arrays, and a compressed structure.
cell = numpy.array(names, dtype=object)
scipy.io.savemat(out / "plain.mat", {"t": t, "q": q, "tau": tau, "names": cell})
structure = {"time": t[:, None], "pos": q.T, "torque": tau.T}
scipy.io.savemat(out / "struct.mat", {"log": structure, "names": cell}, do_compression=True)

# pandas: an index of dates, or no index.
columns = [f"{name}_pos" for name in names] + [f"{name}_effort" for name in names]
dates = pandas.to_datetime("2024-11-20T10:00:00") + pandas.to_timedelta(t, unit="s")
dated = pandas.DataFrame(numpy.column_stack([q, tau]), columns=columns, index=dates)
dated.to_csv(out / "dated.csv")
dated.to_csv(out / "german.csv", sep=";", decimal=",")
dated.to_parquet(out / "dated.parquet")
counted = dated.reset_index(drop=True)
counted.insert(0, "t", t)
counted.to_csv(out / "counted.csv")
for compression in ["snappy", "zstd", "gzip", "lz4", None]:
    counted.to_parquet(out / f"{compression}.parquet", compression=compression)

# LeRobot: cells contain lists, and another file has the names of their elements. Each episode starts at zero.
data = out / "lerobot" / "data" / "chunk-000"
meta = out / "lerobot" / "meta"
data.mkdir(parents=True)
meta.mkdir()
feature = {"dtype": "float32", "shape": [3], "names": {"motors": [f"{name}.pos" for name in names]}}
features = {"observation.state": feature, "action": feature}
(meta / "info.json").write_text(json.dumps({"fps": 100, "features": features}))
for episode in range(2):
    part = slice(200 * episode, 200 * (episode + 1))
    cells = {
        "observation.state": list(q[part].astype("float32")),
        "observation.effort": list(tau[part].astype("float32")),
        "action": list(q[part].astype("float32")),
        "timestamp": t[:200].astype("float32"),
        "episode_index": episode,
    }
    pandas.DataFrame(cells).to_parquet(data / f"episode_{episode:06d}.parquet")


def messages(store):
    """Time and joint state of every sample."""
    types = store.types
    state = types["sensor_msgs/msg/JointState"]
    header = types["std_msgs/msg/Header"]
    stamp = types["builtin_interfaces/msg/Time"]
    for k in range(len(t)):
        ns = 1_700_000_000_000_000_000 + k * 10_000_000
        fields = {"stamp": stamp(sec=ns // 10**9, nanosec=ns % 10**9), "frame_id": "base"}
        if "seq" in header.__dataclass_fields__:
            fields["seq"] = k
        yield ns, state(header(**fields), names, q[k].copy(), numpy.full(3, numpy.nan), tau[k].copy())


# ROS 2: a folder with one file, and a folder with two files.
ros2 = get_typestore(Stores.ROS2_HUMBLE)
for store in [StoragePlugin.SQLITE3, StoragePlugin.MCAP]:
    with Writer2(out / f"bag_{store.name.lower()}", version=9, storage_plugin=store) as writer:
        topic = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=ros2)
        for ns, message in messages(ros2):
            writer.write(topic, ns, ros2.serialize_cdr(message, message.__msgtype__))

ros1 = get_typestore(Stores.ROS1_NOETIC)
for compression in [None, Writer1.CompressionFormat.LZ4, Writer1.CompressionFormat.BZ2]:
    name = compression.name.lower() if compression else "none"
    writer = Writer1(out / f"ros1_{name}.bag")
    if compression:
        writer.set_compression(compression)
    with writer:
        topic = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=ros1)
        for ns, message in messages(ros1):
            writer.write(topic, ns, ros1.serialize_ros1(message, message.__msgtype__))
