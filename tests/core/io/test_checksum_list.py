# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of images beside a bake: what it vouches for, and one sentence for each way in which it is damaged."""

import shutil
import subprocess

import pytest
from sample_bake import grid_texels, write_sensor

from palpate.core.errors import FileError
from palpate.core.io.bake_folder import IMAGE_LIST_NAME, read_checksums, read_manifest
from palpate.core.io.bake_reader import read_bake

IMAGES = [f"tactile_{frame:04d}.exr" for frame in range(1, 8)]


@pytest.fixture
def folder(tmp_path):
    """A sensor's folder with seven images."""
    write_sensor(tmp_path, "pad", grid_texels())
    return tmp_path / "pad"


def fault(folder):
    with pytest.raises(FileError) as error:
        read_bake(folder)
    return str(error.value)


def test_a_whole_bake_passes(folder):
    read_bake(folder)
    assert read_manifest(folder).has_images
    assert [name for name, _ in read_checksums(folder / IMAGE_LIST_NAME)] == IMAGES


def test_other_programs_read_the_list(folder):
    if shutil.which("sha256sum") is None:
        pytest.skip("this system has no sha256sum")
    done = subprocess.run(["sha256sum", "--check", "--strict", IMAGE_LIST_NAME], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.count("OK") == 7


def test_the_damaged_image_is_named(folder):
    (folder / IMAGES[1]).write_bytes(b"other")
    assert f"{IMAGES[1]}' is damaged" in fault(folder)
    (folder / IMAGES[1]).unlink()
    assert f"{IMAGES[1]}' is missing" in fault(folder)


def test_a_damaged_list_is_named(folder):
    path = folder / IMAGE_LIST_NAME
    path.write_bytes(path.read_bytes().replace(b"tactile_0001", b"tactile_0009"))
    assert "images.sha256' is damaged (its content is not what was baked)" in fault(folder)
    path.unlink()
    assert "images.sha256' is missing from the bake: bake again." in fault(folder)
