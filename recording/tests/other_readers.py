"""Reads a MCAP with the reference packages (mcap, mcap-ros2-support) and prints its content.

First line: the topics with their message counts from the index (or "no index").
Then one line per row: log time in ns, and the fields as name=hexadecimal float.
"""

import sys

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, SeekingReader
from mcap_ros2.decoder import DecoderFactory

path, indexed = sys.argv[1], sys.argv[2] == "indexed"
with open(path, "rb") as stream:
    reader = (SeekingReader if indexed else NonSeekingReader)(stream, decoder_factories=[DecoderFactory()])
    if indexed:
        summary = reader.get_summary()
        counts = summary.statistics.channel_message_counts
        print(*(f"{c.topic}:{counts.get(c.id, 0)}" for c in summary.channels.values()), len(summary.chunk_indexes))
        print(*(f"{m.name}:{m.metadata}" for m in reader.iter_metadata()))
    try:
        # Without an index, in the order of the file: sorting would first read to the end, which a truncated file lacks.
        messages = reader.iter_decoded_messages(topics=["/freeplay/tick"], log_time_order=indexed)
        for _, _, message, row in messages:
            fields = (f"{name}={float(getattr(row, name)).hex()}" for name in row.__slots__)
            print(message.log_time, *fields)
    except McapError as error:
        print("stopped:", type(error).__name__)
