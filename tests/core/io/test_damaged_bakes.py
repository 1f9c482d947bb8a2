# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake with a file that is no file, an archive or an image of something else is refused, and nothing is exported of it."""

import os
import shutil
import subprocess
import zipfile

import pytest
from sample_bake import write_bake

from palpate.commands import main
from palpate.core.errors import FileError
from palpate.core.io.bake_folder import IMAGE_LIST_NAME, read_checksums
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.recording_npz import load_recording, load_sensor


@pytest.fixture
def bake(tmp_path):
    write_bake(tmp_path / "bake")
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


def test_the_damaged_file_is_named(bake):
    """Also an image, and the list of images, which a manifest and this list vouch for."""
    for name in ("recording.npz", "tactile_0002.exr", IMAGE_LIST_NAME):
        path = bake / "pad" / name
        whole = path.read_bytes()
        path.write_bytes(whole.replace(b"tactile_0001", b"tactile_0009") if name == IMAGE_LIST_NAME else whole + b"?")
        with pytest.raises(FileError, match=f"pad/{name}' is damaged .its content is not what was baked"):
            read_bake(bake)
        path.unlink()
        with pytest.raises(FileError, match=f"pad/{name}' is missing from the bake: bake again"):
            read_bake(bake)
        path.write_bytes(whole)


def test_other_programs_read_the_list_of_images(bake):
    images = [name for name, _ in read_checksums(bake / "pad" / IMAGE_LIST_NAME)]
    assert images == sorted(path.name for path in (bake / "pad").glob("*.exr")) != []
    command = ["sha256sum", "--check", "--strict", IMAGE_LIST_NAME]
    done = subprocess.run(command, cwd=bake / "pad", capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.count("OK") == len(images)


def test_a_sensor_is_read_once(bake):
    shutil.copytree(bake / "pad", bake / "pad copy")
    with pytest.raises(FileError, match="both hold the sensor 'pad'"):
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
@pytest.mark.parametrize(("file", "load"), [("recording.npz", load_recording), ("sensor.npz", load_sensor)])
def test_a_hostile_archive_is_refused(bake, file, load, content):
    """Also one that its manifest vouches for."""
    with zipfile.ZipFile(bake / "pad" / file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(bake / "pad" / file, "w") as archive:
        for name, data in {**members, next(reversed(members)): content}.items():
            archive.writestr(name, data)
    with pytest.raises(FileError, match="pad"):
        load(bake / "pad" / file)


def test_an_export_of_a_damaged_bake_writes_nothing(bake, tmp_path, capsys):
    replaced_by("other bytes", bake / "pad/recording.npz")
    assert main(["export", str(bake), "--format", "csv", "--out", str(tmp_path / "out")]) == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("palpate export: ") and "recording.npz" in line
    assert not (tmp_path / "out").exists()
