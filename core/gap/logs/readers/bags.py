# SPDX-License-Identifier: GPL-3.0-or-later
"""MCAP files with messages in JSON, of ROS 1 and ROS 2; bags of ROS 1 (``.bag``) and ROS 2 (a folder, ``.db3``)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from ....errors import FileError, imported
from ....io.input_files import open_regular, require_regular
from ..log_table import LARGEST_FILE, LogFile
from .damaged_file import damage_said, read_by
from .message_columns import TopicColumns, is_picture

LARGEST_RECORD = 256 * 2**20
"""Bytes of a record of the file, and of a chunk when it is unpacked."""
MOST_FILES = 1000
"""Files in the folder of a bag."""
INSTALL = "run 'pip install mcap rosbags'"
Decoder = Callable[[bytes], Any]


def read_mcap(path: Path) -> LogFile:
    """Read an MCAP file."""
    topics: dict[str, TopicColumns] = {}
    left_out: dict[str, str] = {}
    with open_regular(path) as file:
        for topic, kind, time, content, decode in _messages(file, path, topics):
            if decode is None:
                left_out.setdefault(topic, kind)
                continue
            with damage_said(path, "MCAP"):
                message = decode(content)
            topics.setdefault(topic, TopicColumns(topic, path)).add(message, time)
    return _log(path, topics, left_out)


def _log(path: Path, topics: dict[str, TopicColumns], left_out: dict[str, str]) -> LogFile:
    """Return the log of some topics; raise FileError if none has enough messages with numbers."""
    made = [topic.table() for topic in topics.values()]
    tables = tuple(table for table, _ in made if table is not None)
    if not tables:
        raise FileError(f"'{path.name}' has no topic with numbers in eight messages or more: give a log of measurements.")
    notes = [f"'{path.name}': {topic} ({kind or 'no type'}) is not read." for topic, kind in left_out.items()]
    return LogFile(path, tables, (*notes, *(said for _, said in made if said)))


def _messages(file: Any, path: Path, topics: dict[str, TopicColumns]) -> Iterator[tuple[str, str, int, bytes, Decoder | None]]:
    """Yield topic, type, time, content and decoder of each message; `topics` are those that were read so far."""
    records = imported("mcap.records", f"'{path.name}'", INSTALL)
    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    decoders: dict[int, Decoder | None] = {}
    for record in read_by(_records(file, path, topics), path, "MCAP"):
        if isinstance(record, records.Schema):
            schemas[record.id] = record
        elif isinstance(record, records.Channel):
            channels[record.id] = record
        elif isinstance(record, records.Message):
            channel = channels.get(record.channel_id)
            if channel is None:
                raise FileError(f"'{path.name}' is damaged (a message of channel {record.channel_id}, unknown): copy it again.")
            schema = schemas.get(channel.schema_id)
            kind = schema.name if schema else channel.message_encoding
            if channel.id not in decoders:
                decoders[channel.id] = None if is_picture(kind) else _decoder_of(channel, schema, path)
            yield channel.topic, kind, record.log_time, record.data, decoders[channel.id]


def _records(file: Any, path: Path, topics: dict[str, TopicColumns]) -> Iterator[Any]:
    """Yield what the library reads; sizes are checked before anything is unpacked."""
    from mcap.exceptions import EndOfFile
    from mcap.records import Chunk
    from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk

    try:
        for outer in StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=LARGEST_RECORD).records:
            if isinstance(outer, Chunk) and outer.uncompressed_size > LARGEST_RECORD:
                raise FileError(f"'{path.name}' has a chunk of {outer.uncompressed_size:,} bytes: it is damaged, or not a log.")
            yield from breakup_chunk(outer, validate_crc=True) if isinstance(outer, Chunk) else [outer]
    except EndOfFile as error:
        rows = sum(table.sample_count for table, _ in (topic.table() for topic in topics.values()) if table is not None)
        until = f" after {rows} messages" if rows else ""
        raise FileError(f"'{path.name}' is cut off{until}: copy it again, or mend it with `mcap recover`.") from error
    except CRCValidationError as error:
        raise FileError(f"'{path.name}' is damaged (a checksum is wrong): copy it again.") from error


def _decoder_of(channel: Any, schema: Any, path: Path) -> Decoder | None:
    """Return the decoder of a channel's messages; None if they are not read."""
    if channel.message_encoding == "json":
        return json.loads
    if schema is None or schema.encoding not in ("ros2msg", "ros1msg"):
        return None
    typesys = imported("rosbags.typesys", f"'{path.name}'", INSTALL)
    store, name = typesys.get_typestore(typesys.Stores.EMPTY), schema.name
    if name.count("/") == 1:  # as ROS 1 writes it
        name = name.replace("/", "/msg/")
    with damage_said(path, "MCAP"):
        types = typesys.get_types_from_msg(schema.data.decode(), name)
        with suppress(KeyError):
            store.register(types)
    decode = store.deserialize_ros1 if schema.encoding == "ros1msg" else store.deserialize_cdr
    return lambda content: decode(content, name)


def read_bag(path: Path) -> LogFile:
    """Read a bag."""
    if path.is_dir():
        files = sorted(path.iterdir())[: MOST_FILES + 1]
        if len(files) > MOST_FILES:
            raise FileError(f"'{path}' has more than {MOST_FILES} files: give the folder of a bag.")
        for file in files:
            require_regular(file)
        if sum(file.stat().st_size for file in files if file.is_file()) > LARGEST_FILE:
            raise FileError(f"'{path.name}' holds more than {LARGEST_FILE >> 30} GB: record the topics of the sensor alone.")
        logs = [file for file in files if file.suffix == ".mcap"]
        if len(logs) == 1:
            return replace(read_mcap(logs[0]), path=path)
        if not logs and not any(file.suffix == ".db3" for file in files):
            raise FileError(f"'{path}' holds no bag: give a folder with metadata.yaml and a .db3 or .mcap file.")
    highlevel, typesys = (imported(f"rosbags.{one}", f"'{path.name}'", INSTALL) for one in ("highlevel", "typesys"))
    topics: dict[str, TopicColumns] = {}
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with ExitStack() as stack:
        with damage_said(path, "a bag"):
            reader = stack.enter_context(highlevel.AnyReader([path], default_typestore=store))
        known = [one for one in reader.connections if not is_picture(one.msgtype) and one.msgtype in reader.typestore.fielddefs]
        left_out = {one.topic: one.msgtype for one in reader.connections if one not in known}
        for connection, time, content in read_by(reader.messages(connections=known), path, "a bag") if known else ():
            with damage_said(path, "a bag"):
                message = reader.deserialize(content, connection.msgtype)
            topics.setdefault(connection.topic, TopicColumns(connection.topic, path)).add(message, time)
    return _log(path, topics, left_out)
