# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake with a file that is no file, an archive or an image of something else is refused, and nothing is exported of it."""

import os
import shutil
import zipfile

import numpy as np
import pytest
from sample_bake import write_bake

from palpate.commands import main
from palpate.core.errors import FileError
from palpate.core.export.registry import exporters
from palpate.core.io.bake_reader import read_bake


@pytest.fixture(params=[False, True], ids=["older", "with checksums"])
def bake(request, tmp_path):
    write_bake(tmp_path / "bake", request.param)
    assert sorted(read_bake(tmp_path / "bake").texels) == ["cap", "pad"]
    return tmp_path / "bake"


def replaced_by(kind, path):
    """Put something else in the place of a file."""
    if kind == "other bytes":
        path.write_bytes(bytes(512))
        return
    path.unlink()
    if kind == "a folder":
        path.mkdir()
    elif kind == "a FIFO":
        os.mkfifo(path)
    elif kind == "a link to a device":
        path.symlink_to("/dev/zero")
    elif kind == "a link to nothing":
        path.symlink_to("nowhere")


FILES = ("pad/recording.npz", "pad/sensor.npz", "pad/manifest.json", "pad/tactile_0002.exr")
KINDS = ("nothing", "other bytes", "a folder", "a FIFO", "a link to a device", "a link to nothing")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("file", FILES)
def test_a_file_that_is_none_is_refused(bake, file, kind):
    replaced_by(kind, bake / file)
    with pytest.raises(FileError, match="pad"):
        read_bake(bake)


@pytest.mark.parametrize("source", ["pad/tactile_0003.exr", "cap/tactile_0002.exr"])
def test_an_image_of_another_frame_or_sensor_is_refused(bake, source):
    shutil.copy(bake / source, bake / "pad/tactile_0002.exr")
    with pytest.raises(FileError, match=r"tactile_0002\.exr"):
        read_bake(bake)


def npy(header: str) -> bytes:
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()


@pytest.mark.parametrize(
    "content",
    [
        b"no array",
        npy("__import__('os').abort()"),
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000,), }\n") + bytes(80),
        npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }\n") + b"cos\nabort\n(tR.",
    ],
    ids=["no array", "code in a header", "a petabyte", "a pickle"],
)
@pytest.mark.parametrize("file", ["pad/recording.npz", "pad/sensor.npz"])
def test_a_hostile_archive_is_refused(bake, file, content):
    with zipfile.ZipFile(bake / file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(bake / file, "w") as archive:
        for name, data in {**members, next(reversed(members)): content}.items():
            archive.writestr(name, data)
    with pytest.raises(FileError, match="pad"):
        read_bake(bake)


@pytest.mark.parametrize("kind", list(exporters()))
def test_an_export_of_a_damaged_bake_writes_nothing(bake, tmp_path, kind, capsys):
    with np.load(bake / "pad/recording.npz") as members:
        arrays = {name: members[name] for name in members.files}
    arrays["times"] = arrays["times"][::-1]
    np.savez(bake / "pad/recording.npz", **arrays)
    assert main(["export", str(bake), "--format", kind, "--out", str(tmp_path / "out")]) == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("palpate export: ") and "recording.npz" in line
    assert not (tmp_path / "out").exists()
