# SPDX-License-Identifier: GPL-3.0-or-later
"""What a killed bake leaves, damaged with its structure in mind, and the bake that finds it.

Damage that the checksums tell restarts the bake, and it ends with the bytes of one that was never killed. Where the
checksums were made to fit, as a hostile file's would, the bake ends as a whole or in one sentence: kernels follow no number
that leads out, and no number that is not finite reaches a file.
"""

from __future__ import annotations

import hashlib
import io
import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from palpate.core.effects.engine.registry import effect
from palpate.core.geometry.mesh import TriangleMesh, mass_properties
from palpate.core.io import bake_switch
from palpate.core.io.bake_folder import IMAGE_LIST_NAME
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.frame_rows import row_type
from palpate.core.io.private_folder import PRIVATE_FOLDER
from palpate.core.model.body import Body
from palpate.core.model.drive import Drive
from palpate.core.model.motion import Motion, Signal
from palpate.core.model.scenario import Scenario
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.model.target import Target
from palpate.core.solver import checkpoint
from palpate.core.solver.simulation import Simulation, solve_frames

from .sample_bake import COLUMNS, PITCH, ROWS, grid_texels

FRAMES, KILLED = 8, 4
"""Frames of the bake, and those it had when it was killed."""
VOUCHED = "vouched"
"""Name of a file beside the bake: the checksums were made to fit what is damaged."""
CUBE = 0.02


def _cube() -> TriangleMesh:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * CUBE / 2
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return TriangleMesh(corners, np.array([triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])]))


@cache
def scenario() -> Scenario:
    """A finger with a controller and effects of all kinds of memory presses a cube that lies on a table of texels."""
    texels, mesh = grid_texels(), _cube()
    middle = np.array([(COLUMNS - 1) * PITCH / 2, (ROWS - 1) * PITCH / 2, 0.0])
    effects = (
        effect("creep"),
        effect("hysteresis", "play"),
        effect("lag", "dead-time", time=0.07),
        effect("lag", "second-order", time=0.1),
        effect("drift", "random-walk", seed=2),
        effect("noise", seed=3),
    )
    parameters = SensorParameters(k=300.0, cn=3.0)
    center, inertia, _ = mass_properties(mesh, 0.05, "cube")
    over, turned = middle + [0.0, 0.0, CUBE], np.array([0.0, 1.0, 0.0, 0.0])  # the finger looks down
    drive = Drive("force", Signal.constant(0.4), sensor=1, max_speed=0.02)
    return Scenario(
        bodies=(
            Body("table", Motion.at_rest()),
            Body("cube", Motion.at_rest(middle + [0, 0, CUBE / 2 - 1e-4]), True, 0.05, center, inertia),
            Body("finger", Motion.at_rest(over + [-middle[0], middle[1], 1e-3], turned), mass=0.1, drive=drive),
        ),
        sensors=(Sensor("pad", 0, texels, parameters, effects=effects), Sensor("tip", 2, texels, parameters)),
        targets=(Target("cube", 1, mesh),),
        frame_end=FRAMES,
        gravity=np.array([0.0, 0.0, -9.81]),
        dt=1e-3,
    )


def bake(folder: Path, frames: int | None = None) -> list[str]:
    """Bake the scenario into a folder and return what it says; with `frames`, be killed after so many."""
    from palpate.addon.bake import bake_checkpoint, bake_files

    simulation = Simulation(scenario())
    files = bake_files.BakeFiles(folder, scenario())
    if frames is not None:
        with _no_waiting(bake_checkpoint):
            files.resume(simulation)
            job = solve_frames(simulation, files.write_frame)
            for _ in range(frames):
                next(job)
            files.save_checkpoint(simulation)
        files._writer.stop()
        files._close()
        files._lock.release()
        return files.notes
    with files:
        for _ in solve_frames(simulation, files.write_frame, files.resume(simulation)):
            pass
        files.complete(files.recording(simulation, simulation.warnings))
        files.switch()
    bake_switch.wait_for_removals()
    return files.notes


@contextmanager
def _no_waiting(module: Any) -> Iterator[None]:
    before = module.CHECKPOINT_INTERVAL, module.MAX_COST_SHARE
    module.CHECKPOINT_INTERVAL, module.MAX_COST_SHARE = 0.0, float("inf")
    try:
        yield
    finally:
        module.CHECKPOINT_INTERVAL, module.MAX_COST_SHARE = before


@cache
def unfinished() -> dict[str, bytes]:
    """What a killed bake leaves, by path."""
    return _files_of(KILLED)


@cache
def whole() -> dict[str, bytes]:
    """The files of a bake that was never killed, by path."""
    return _files_of(None)


def _files_of(frames: int | None) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory(prefix="palpate-attack-") as name:
        bake(Path(name) / "bake", frames)
        return {str(path.relative_to(name)): path.read_bytes() for path in Path(name).rglob("*") if path.is_file()}


def inputs(damaged_archive: Any, damaged_bytes: Any) -> st.SearchStrategy[dict[str, bytes]]:
    """Draw unfinished bakes in which one or two files are damaged, with or without checksums that fit."""

    @st.composite
    def draw_one(draw: Any) -> dict[str, bytes]:
        files = dict(unfinished())
        state = next(path for path in files if path.endswith("state.npz"))
        others = [path for path in sorted(files) if path.endswith((".rows", IMAGE_LIST_NAME, "0002.exr"))]
        for path in draw(st.sampled_from([[state], [state], [state], *([other] for other in others), [state, others[0]]])):
            files[path] = draw(damaged_archive(files[path]) if path == state else _damaged_lines(files[path], damaged_bytes))
        if draw(st.booleans()):
            vouched = with_checksums(files, state)
            if vouched is not None:
                return {**files, state: vouched, VOUCHED: b""}
        return files

    return draw_one()


def _damaged_lines(content: bytes, damaged_bytes: Any) -> st.SearchStrategy[bytes]:
    """A file with damaged bytes, or with a line of a list, or a part of the rows, twice, missing or exchanged."""
    lines = content.splitlines(keepends=True)
    return st.one_of(
        damaged_bytes(content),
        st.sampled_from(
            [
                b"",
                content * 2,
                b"".join(lines[1:]),
                b"".join(lines[:1] * len(lines)),
                b"".join(lines[::-1]),
                b"0" * 64 + b"  ../../../../notes.txt\n" + b"".join(lines[1:]),
                content[: len(content) // 2] + b"\0\0\0\0\0\0\xf8\x7f" * 8 + content[len(content) // 2 + 64 :],
            ]
        ),
    )


def with_checksums(files: dict[str, bytes], state: str) -> bytes | None:
    """Return a state whose checksums fit the damaged files; None where it cannot be read any more."""
    try:
        with np.load(io.BytesIO(files[state]), allow_pickle=False) as members:
            arrays = {name: members[name] for name in members.files}
        about = json.loads(str(arrays["about"]))
        rows = next(content for path, content in files.items() if path.endswith(".rows"))
        texels = {sensor.name: len(sensor.texels) for sensor in scenario().sensors}
        used = rows[: about["frames"] * row_type(len(scenario().bodies), texels).itemsize]
        about["rows_sha256"] = hashlib.sha256(used).hexdigest()
        for path, content in files.items():
            if path.endswith(IMAGE_LIST_NAME):
                about["images"][Path(path).parent.name] = len(content), hashlib.sha256(content).hexdigest()
        arrays["about"] = np.array(json.dumps(about))
        arrays.pop("sha256", None)
        arrays["sha256"] = np.array(checkpoint.digest(arrays))
    except Exception:  # what cannot be read needs no checksum
        return None
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def read(folder: Path) -> None:
    """Let a bake find the damaged files; raise AssertionError if it ends with something else than it should."""
    notes = bake(folder / "bake")
    assert all(len(note.splitlines()) == 1 for note in notes), f"no clear sentence: {notes}"
    found = read_bake(folder / "bake")
    assert found.recording.frames.tolist() == list(scenario().frames), "other frames"
    if not (folder / VOUCHED).exists():
        for path, content in whole().items():
            if PRIVATE_FOLDER not in path:
                assert (folder / path).read_bytes() == content, f"other bytes in {Path(path).name}"
