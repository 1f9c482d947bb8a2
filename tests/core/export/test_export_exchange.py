# SPDX-License-Identifier: GPL-3.0-or-later
"""An export takes the place of the earlier one as a whole, whenever it is stopped, and leaves nothing hidden behind."""

import json
import shutil
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace

import pytest
from file_faults import KILL, Injector, Stopped

from palpate.core.errors import FileError
from palpate.core.export import registry
from palpate.core.export.exporter import Exporter
from palpate.core.export.registry import export
from palpate.core.io import file_list
from palpate.core.io.file_list import LIST_FORMAT, LIST_NAME
from palpate.core.io.file_writing import atomic_write, writable_folder
from palpate.core.io.private_folder import MARKER_NAME
from palpate.core.io.temporary_folder import remove_unfinished, temporary_folder
from palpate.core.jobs.job_runner import run_job

OLD = {"bodies.csv": "old", "pad/force.csv": "old", "pad/gone.csv": "old"}
NEW = {"bodies.csv": "new", "pad/force.csv": "new", "tip/force.csv": "new"}


def write(files, folder, _style):
    """Write files as an exporter does; it yields nothing."""
    written = []
    for name, text in files.items():
        path = folder / name
        writable_folder(path.parent, create=True)
        with atomic_write(path) as temporary:
            temporary.write_text(text)
        written.append(path)
    return written
    yield


@pytest.fixture
def formats(monkeypatch):
    """A format of plain text; a "bake" is a dictionary of files."""
    known = {name: Exporter(name, name, "", i, write, lambda _: 0.0) for i, name in enumerate(("text", "other"))}
    monkeypatch.setattr(registry, "exporters", lambda: known)


@pytest.fixture
def out(tmp_path, formats):
    """A folder with an export and a file of the user's."""
    out = tmp_path / "start" / "out"
    out.parent.mkdir()
    run_job(export(OLD, "text", out))
    (out / "pad" / "mine.txt").write_text("mine")
    return out


def files_in(folder):
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def exported(folder):
    """The files of exports, without the list and the user's own."""
    found = files_in(folder).items()
    return {name: text for name, text in found if not any(part[0] == "." for part in name.split("/")) and "mine" not in name}


def is_complete(folder):
    return json.loads((folder / LIST_NAME).read_text())["exports"]["text"]["complete"]


def hidden(folder):
    return sorted(path.name for path in folder.rglob(".*"))


def test_an_export_takes_the_place_of_the_earlier_one(out):
    written = run_job(export(NEW, "text", out))
    assert written == [out / "bodies.csv", out / "pad", out / "tip"]
    assert exported(out) == NEW and (out / "pad" / "mine.txt").read_text() == "mine"
    assert hidden(out) == [LIST_NAME] and is_complete(out)
    assert run_job(export(NEW, "text", out)) == written


def number_of_calls(out, tmp_path):
    copy = tmp_path / "count"
    shutil.copytree(out, copy)
    with Injector(copy) as injector:
        run_job(export(NEW, "text", copy))
    return len(injector.calls)


@pytest.mark.parametrize("kind", [KILL, "EIO", "DONE"])
def test_stopped_at_every_step(out, tmp_path, kind):
    states = []
    for number in range(1, number_of_calls(out, tmp_path) + 1):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(out, copy)
        with Injector(copy, number, kind) as injector, suppress(Stopped, FileError):
            run_job(export(NEW, "text", copy))
        assert len(injector.calls) >= number
        found = exported(copy)
        ages = set(found.values())
        assert len(ages) <= 1, f"old and new files beside each other after call {number}"
        if is_complete(copy):
            assert found in (OLD, NEW)
        states.append(ages)
        run_job(export(NEW, "text", copy))
        assert exported(copy) == NEW and is_complete(copy) and hidden(copy) == [LIST_NAME]
        assert (copy / "pad" / "mine.txt").read_text() == "mine"
    assert {"old"} in states and {"new"} in states
    if kind == KILL:  # until all files are complete, the old export stays
        first = next(i for i, ages in enumerate(states) if ages != {"old"})
        assert first > len(states) // 2 and {"old"} not in states[first:]


def test_the_next_export_of_another_format_completes_a_killed_one(out, tmp_path):
    completed = 0
    for number in range(1, number_of_calls(out, tmp_path) + 1):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(out, copy)
        with Injector(copy, number, KILL), suppress(Stopped):
            run_job(export(NEW, "text", copy))
        was_complete = is_complete(copy)
        run_job(export({"other.txt": "other"}, "other", copy))
        found = exported(copy)
        assert found.pop("other.txt") == "other"
        assert found in (OLD, NEW) and is_complete(copy) and hidden(copy) == [LIST_NAME]
        completed += not was_complete
        assert was_complete or found == NEW
    assert completed > 3


@pytest.mark.parametrize("other", [False, True])
def test_an_error_while_files_are_moved_loses_no_new_file(out, tmp_path, other):
    """The old export is gone by then: the new one stays whole in hiding, and any next export completes it."""
    kept = told = 0
    for number in range(1, number_of_calls(out, tmp_path) + 1):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(out, copy)
        said = ""
        try:
            with Injector(copy, number, "EACCES"):
                run_job(export(NEW, "text", copy))
        except FileError as error:
            said = str(error)
        if is_complete(copy):
            continue
        kept += 1
        moved = {name: text for name, text in exported(copy).items() if text == "new"}
        folders = copy.glob(".palpate-export.*.partial")  # none if only the list could not be written in the end
        waiting = {name: text for new in folders for name, text in exported(new).items() if text == "new"}
        assert moved | waiting == NEW and not moved.keys() & waiting.keys()
        if "could not be replaced (permission denied): " in said:
            told += 1
            assert f"{len(moved)} of {len(NEW)} new files are in their place, the others wait there in a hidden folder." in said
            assert str(copy) in said
        run_job(export({"other.txt": "other"}, "other", copy) if other else export(NEW, "text", copy))
        assert {name: text for name, text in exported(copy).items() if name != "other.txt"} == NEW
        assert is_complete(copy) and hidden(copy) == [LIST_NAME]
    assert kept > 3 and told > 2


def test_a_folder_that_cannot_be_written_to_is_found_before_the_old_export_is_touched(out, monkeypatch):
    def writable(folder, create=False):
        if folder.name == "tip":
            raise FileError(f"'{folder}' is read-only.")
        return writable_folder(folder, create)

    (out / "tip").mkdir()
    monkeypatch.setattr(file_list, "writable_folder", writable)
    with pytest.raises(FileError, match="read-only"):
        run_job(export(NEW, "text", out))
    assert exported(out) == OLD and hidden(out) == [LIST_NAME] and is_complete(out)


def test_a_process_that_ends_keeps_what_waits_for_its_place(out, tmp_path):
    run_job(export({"other.txt": "other"}, "other", out))
    calls = number_of_calls(out, tmp_path)
    for number in range(calls // 2, calls + 1):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(out, copy)
        with Injector(copy, number, KILL), suppress(Stopped):
            run_job(export(NEW, "text", copy))
        was_complete, was_old = is_complete(copy), exported(copy) == {**OLD, "other.txt": "other"}
        file_list.remove_unneeded(copy)
        file_list.FileList(copy)
        found = exported(copy)
        assert found.pop("other.txt") == "other" and is_complete(copy) and hidden(copy) == [LIST_NAME]
        assert found == (OLD if was_complete and was_old else NEW)


def test_files_of_several_kinds_are_exchanged_together_and_those_of_one_source_are_gathered(tmp_path):
    def write_from(source, *names):
        files = file_list.FileList(tmp_path)
        with files.new_files("figures") as new:
            for name in names:
                (new / name).write_text(source)
            written = {f"figures {name[0]}": [new / name] for name in names}
            return files.replace(new, written, source)

    write_from("first", "a 1", "b 1")
    assert write_from("first", "a 2") == [tmp_path / "a 2"]
    assert exported(tmp_path) == {"a 1": "first", "a 2": "first", "b 1": "first"}
    (tmp_path / "a 1").write_text("mine now")
    write_from("second", "a 3")
    assert exported(tmp_path) == {"a 1": "mine now", "a 3": "second", "b 1": "first"}


def test_two_formats_share_a_file(out):
    run_job(export({"bodies.csv": "other"}, "other", out))
    run_job(export({"tip/force.csv": "new"}, "text", out))
    assert exported(out) == {"bodies.csv": "other", "tip/force.csv": "new"}


def test_what_is_in_the_way_is_found_before_the_old_export_is_touched(out, tmp_path):
    (out / "tip").mkdir()
    (out / "tip" / "force.csv").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        run_job(export(NEW, "text", out))
    assert exported(out) == OLD and hidden(out) == [LIST_NAME]
    shutil.rmtree(out / "tip")
    (out / "tip").write_text("mine")
    with pytest.raises(FileError, match="where a folder is needed"):
        run_job(export(NEW, "text", out))
    assert {**exported(out), "tip": "old"} == {**OLD, "tip": "old"} and (out / "tip").read_text() == "mine"


def test_a_link_stays_a_link(out, tmp_path):
    target = tmp_path / "elsewhere.csv"
    target.write_text("old")
    (out / "bodies.csv").unlink()
    (out / "bodies.csv").symlink_to(target)
    run_job(export(NEW, "text", out))
    assert (out / "bodies.csv").is_symlink() and target.read_text() == "new"


def test_an_error_names_the_place_of_the_file(out):
    def fail(_bake, folder, _style):
        raise FileError(f"'{folder / 'pad.csv'}' could not be written (no space left on device): free some space.")
        yield

    registry.exporters()["text"] = replace(registry.exporters()["text"], write=fail)
    with pytest.raises(FileError) as caught:
        run_job(export(NEW, "text", out))
    assert str(caught.value).startswith(f"'{out / 'pad.csv'}' could not be written")
    assert exported(out) == OLD and hidden(out) == [LIST_NAME] and is_complete(out)


@pytest.mark.parametrize("name", ["../victim.txt", "link/victim.txt", "a\0b"])
def test_a_list_from_the_net_moves_nothing_out_of_the_folder(out, tmp_path, name):
    (tmp_path / "victim.txt").write_text("victim")
    (out / "link").symlink_to(tmp_path)
    new = out / ".palpate-export.01234567.partial"
    (new / "link").mkdir(parents=True)
    (new / "link" / "victim.txt").write_text("hostile")
    (new / "victim.txt").write_text("hostile")
    listed = {"complete": False, "files": {name: "0" * 64}, "replaced": {name: "0" * 64}, "new_in": new.name}
    (out / LIST_NAME).write_text(json.dumps({"format": LIST_FORMAT, "exports": {"text": listed}}))
    run_job(export(NEW, "text", out))
    assert (tmp_path / "victim.txt").read_text() == "victim"


def test_what_killed_runs_have_left_is_removed_and_nothing_else(tmp_path):
    leftover, running = tmp_path / ".report.0123abcd.partial.html", tmp_path / "running.txt"
    mine = tmp_path / ".palpate-video.01234567.partial"
    leftover.write_text("half")
    mine.mkdir()
    (mine / "thesis.txt").write_text("mine")
    with suppress(Stopped), temporary_folder(tmp_path, "export") as abandoned:
        (abandoned / "half.csv").write_text("half")
        kept = tmp_path / "kept"
        shutil.copytree(abandoned, kept)
    kept.rename(abandoned)  # as a kill leaves it
    torn = tmp_path / ".palpate-export.89abcdef.partial"  # as a power cut leaves it
    torn.mkdir()
    (torn / MARKER_NAME).write_bytes(bytes(70))
    (torn / "half.csv").write_text("half")
    with temporary_folder(tmp_path, "video") as in_use, atomic_write(running) as temporary:
        temporary.write_text("running")
        remove_unfinished(tmp_path)
        assert in_use.is_dir() and temporary.is_file()
        assert not abandoned.exists() and not torn.exists() and not leftover.exists()
    assert running.read_text() == "running"
    assert (mine / "thesis.txt").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == [mine.name, "running.txt"]


def test_a_file_that_another_process_writes_is_no_leftover(tmp_path):
    program = (
        "import sys\n"
        "from palpate.core.io.file_writing import atomic_write\n"
        "with atomic_write(sys.argv[1]) as temporary:\n"
        "    temporary.write_text('whole')\n"
        "    print('writing', flush=True)\n"
        "    sys.stdin.readline()\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "report.html")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "writing\n"
        remove_unfinished(tmp_path)
        process.communicate("\n")
    assert process.returncode == 0 and (tmp_path / "report.html").read_text() == "whole"
