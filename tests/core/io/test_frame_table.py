# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a run come back bit for bit, and no length of a run fills the memory."""

import errno
import tempfile
from pathlib import Path

import numpy as np
import pytest
from sample_bake import tactile_frame

from palpate.core.errors import FileError
from palpate.core.io import row_tables
from palpate.core.io.recording_npz import save_recording
from palpate.core.io.row_tables import FrameTable, motion_table
from palpate.core.model import recording as model
from palpate.core.model.recording import SENSOR_FIELDS, Frame, Recording

TEXELS = {"Finger/A": 5, "pad": 1}
BODIES = ("world", "finger")


def frames(count, seed=3):
    rng, found = np.random.default_rng(seed), []
    for i in range(count):
        sensors = {name: tactile_frame(n, rng) for name, n in TEXELS.items()}
        found.append(Frame(i + 7, i / 24, sensors, rng.normal(size=(2, 7)), rng.normal(size=(2, 6))))
    return found


def written(folder, wanted):
    rows = FrameTable(BODIES, folder)
    for frame in wanted:
        rows.append(frame)
    return rows


def arrays_of(recording):
    found = {name: getattr(recording, name) for name in ("frames", "times", "poses", "velocities")}
    for sensor, own in recording.sensors.items():
        found |= {f"{sensor}/{name}": getattr(own, name) for name in SENSOR_FIELDS}
    return found


@pytest.mark.parametrize("mapped", [False, True])
def test_frames_come_back_bit_for_bit(tmp_path, monkeypatch, mapped):
    wanted = frames(40)
    if mapped:
        monkeypatch.setattr(row_tables, "IN_MEMORY_BYTES", 0)
        monkeypatch.setattr(model, "BLOCK_BYTES", 2000)  # a few frames
    rows = written(tmp_path, wanted)
    found, expected = rows.recording(1e-4, "d", ["careful"], "because"), Recording.stack(wanted, BODIES, 1e-4, "d")
    del rows  # as at the end of a bake
    assert found.warnings == ("careful",) and found.step_reason == "because" and found.dt == 1e-4
    for name, array in arrays_of(expected).items():
        own = arrays_of(found)[name]
        assert own.dtype == array.dtype and own.tobytes() == array.tobytes(), name
        assert own.flags.writeable != mapped
    parts = [arrays_of(part) for part in found.blocks()]
    assert (len(parts) > 5) == mapped
    for name, array in arrays_of(expected).items():
        assert np.concatenate([part[name] for part in parts]).tobytes() == array.tobytes()
    save_recording(tmp_path / "streamed.npz", found)
    expected.warnings, expected.step_reason = found.warnings, found.step_reason
    save_recording(tmp_path / "at once.npz", expected)
    assert (tmp_path / "streamed.npz").read_bytes() == (tmp_path / "at once.npz").read_bytes()


@pytest.mark.skipif(not Path("/proc/self/smaps").exists(), reason="only Linux tells what of a file is in memory")
def test_blocks_leave_no_file_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(row_tables, "IN_MEMORY_BYTES", 0)
    monkeypatch.setattr(model, "BLOCK_BYTES", 1 << 16)
    rows = written(tmp_path, frames(3000))
    found = rows.recording(1e-4, "", (), "")

    def resident():
        parts = Path("/proc/self/smaps").read_text().split(f"{tmp_path}/")
        return int(parts[1].split("Rss:")[1].split()[0])

    assert np.isfinite(found.poses).all() and resident() > 1000  # kB: all of it was read
    assert sum(len(part.frames) for part in found.blocks()) == 3000
    assert resident() < 200


def test_a_number_that_is_not_finite_reaches_no_file(tmp_path):
    rows, (frame,) = written(tmp_path, []), frames(1)
    frame.sensors["pad"].slip[0] = np.nan
    with pytest.raises(ValueError, match=r"sensor_1/slip' of frame 7"):
        rows.append(frame)


def test_a_full_temporary_folder_is_one_sentence(monkeypatch):
    class Full:
        def write(self, _content):
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tempfile, "SpooledTemporaryFile", lambda *_, **_options: Full())
    said = r"^The motion of a long scene could not be kept in .*\(no space left on device\): free"
    with pytest.raises(FileError, match=said):
        motion_table(np.zeros(3))
