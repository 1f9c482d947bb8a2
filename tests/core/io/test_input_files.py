# SPDX-License-Identifier: GPL-3.0-or-later
"""No reader waits for a FIFO or reads a device: each refuses it at once, in one sentence."""

import os
import socket
import time

import pytest

from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.io.bake_folder import read_manifest
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.csv_table import read_table
from palpate.core.io.input_files import open_regular, read_bytes
from palpate.core.io.recording_npz import load_recording, load_sensor
from palpate.core.io.sensor_toml import read_sensor
from palpate.core.simulators.openrave_file import read_openrave

READERS = (
    load_recording,
    load_sensor,
    read_bytes,
    read_openrave,
    read_rig,
    read_sensor,
    read_table,
)

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFOs")


@pytest.fixture(params=["a FIFO", "a socket", "a device"])
def special(request, tmp_path, monkeypatch):
    """Path of a special file, through a link, and what it is called."""
    monkeypatch.chdir(tmp_path)  # the name of a socket may have only some hundred characters
    if request.param == "a FIFO":
        os.mkfifo("special")
        target = tmp_path / "special"
    elif request.param == "a socket":
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind("special")
        target = tmp_path / "special"
    else:
        target = "/dev/zero"
    link = tmp_path / "link"
    link.symlink_to(target)
    return link, request.param


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: f"{reader.__module__.rpartition('.')[2]}.{reader.__name__}")
def test_special_files_are_refused(reader, special):
    path, kind = special
    began = time.monotonic()
    with pytest.raises(FileError, match=f"^'.*' is {kind}, not a file: give the name of a regular file.$"):
        reader(path)
    assert time.monotonic() - began < 5


def test_a_special_file_in_a_bake_folder_is_refused(special):
    path, kind = special
    path.rename(path.with_name("manifest.json"))
    with pytest.raises(FileError, match=f"is {kind}"):
        read_manifest(path.parent)
    with pytest.raises(FileError, match=f"is {kind}"):
        read_bake(path.parent)


@pytest.mark.parametrize("mode", ["rb", "ab", "r+b"])
def test_a_special_file_is_not_written_to_either(special, mode):
    path, kind = special
    with pytest.raises(FileError, match=f"is {kind}"):
        open_regular(path, mode)


def test_regular_files_open_as_ever(tmp_path):
    path = tmp_path / "file"
    with open_regular(path, "w", encoding="utf-8") as file:
        file.write("grün")
    with open_regular(path, "r", encoding="utf-8") as file:
        assert file.read() == "grün"
    with pytest.raises(FileNotFoundError):
        open_regular(tmp_path / "missing")
    with pytest.raises(IsADirectoryError):
        open_regular(tmp_path)
