# SPDX-License-Identifier: GPL-3.0-or-later
"""Bags of ROS 1 (``.bag``) and ROS 2 (a folder, ``.db3``), read by rosbags; ROS is not needed."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from ....errors import FileError
from ....io.input_files import require_regular
from ..log_table import LARGEST_FILE, LogFile
from .damaged_file import damage_said, read_by
from .mcap_log import log_of, read_mcap
from .message_columns import TopicColumns, is_picture

MOST_FILES = 1000
"""Files in the folder of a bag."""


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
            found = read_mcap(logs[0])
            return LogFile(path, "ROS 2 bag", found.tables, found.notes)
        if not logs and not any(file.suffix == ".db3" for file in files):
            raise FileError(f"'{path}' holds no bag: give a folder with metadata.yaml and a .db3 or .mcap file.")
    return _read_with_rosbags(path)


def _read_with_rosbags(path: Path) -> LogFile:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise FileError(f"'{path.name}' needs the package rosbags: install it with 'pip install rosbags'.") from error
    topics: dict[str, TopicColumns] = {}
    left_out: dict[str, str] = {}
    with ExitStack() as stack:
        with damage_said(path, "a bag"):
            reader = stack.enter_context(AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)))
        known = [one for one in reader.connections if not is_picture(one.msgtype) and one.msgtype in reader.typestore.fielddefs]
        left_out |= {one.topic: one.msgtype for one in reader.connections if one not in known}
        for connection, time, content in read_by(reader.messages(connections=known), path, "a bag") if known else ():
            with damage_said(path, "a bag"):
                message = reader.deserialize(content, connection.msgtype)
            topics.setdefault(connection.topic, TopicColumns(connection.topic, path)).add(message, time)
    return log_of(path, "ROS 1 bag" if path.suffix == ".bag" else "ROS 2 bag", topics, left_out)
