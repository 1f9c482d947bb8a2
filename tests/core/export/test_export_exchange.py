# SPDX-License-Identifier: GPL-3.0-or-later
"""An export takes the place of the earlier one as a whole, whenever it is stopped, and leaves nothing hidden behind."""

import gc
import hashlib
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from kills import stopped_at

from palpate.core.errors import FileError
from palpate.core.export import exporter
from palpate.core.export.exporter import Exporter, export
from palpate.core.io import hidden_folder
from palpate.core.io.file_writing import atomic_write, writable_folder
from palpate.core.io.hidden_folder import LIST_FORMAT, LIST_NAME
from palpate.core.jobs import run_job

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
    known = {name: Exporter(name, write) for name in ("text", "other")}
    monkeypatch.setattr(exporter, "exporter_for", known.__getitem__)
    return known


@pytest.fixture
def out(tmp_path, formats):
    """A folder with an export and a file of the user's."""
    out = tmp_path / "start" / "out"
    out.parent.mkdir()
    run_job(export(OLD, "text", out))
    (out / "pad" / "mine.txt").write_text("mine")
    return out


def exported(folder):
    """The files of exports, without the list and the user's own."""
    found = {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}.items()
    return {name: text for name, text in found if not any(part[0] == "." for part in name.split("/")) and "mine" not in name}


def hidden(folder):
    return sorted(path.name for path in folder.rglob(".*") if ".partial" not in path.name)


def test_an_export_takes_the_place_of_the_earlier_one(out):
    written = run_job(export(NEW, "text", out))
    assert written == [out / "bodies.csv", out / "pad", out / "tip"]
    assert exported(out) == NEW and (out / "pad" / "mine.txt").read_text() == "mine"
    assert hidden(out) == [LIST_NAME]
    assert run_job(export(NEW, "text", out)) == written


@pytest.mark.long("exports thrice for each step")
def test_stopped_at_any_step_the_next_export_is_whole(out, tmp_path):
    states = []
    for number in range(1, 100):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(out, copy)
        with stopped_at(number) as steps:
            run_job(export(NEW, "text", copy))
        if len(steps) < number:
            break
        gc.collect()  # the lock of the stopped process
        found = exported(copy)
        assert set(found.values()) <= {"old", "new"}
        states.append(found)
        run_job(export({"other.txt": "other"}, "other", copy))
        assert exported(copy) == {**found, "other.txt": "other"}
        run_job(export(NEW, "text", copy))
        assert exported(copy) == {**NEW, "other.txt": "other"} and hidden(copy) == [LIST_NAME]
        assert (copy / "pad" / "mine.txt").read_text() == "mine"
    assert 10 < number < 99 and OLD in states and NEW in states and any(state not in (OLD, NEW) for state in states)


def test_an_error_while_files_are_moved_is_one_sentence(out, monkeypatch):
    move = os.replace

    def refuse(source, target):
        if Path(target) == out / "pad" / "force.csv":
            raise PermissionError(13, "Permission denied")
        move(source, target)

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(FileError) as caught:
        run_job(export(NEW, "text", out))
    assert str(caught.value).startswith(f"'{out / 'pad' / 'force.csv'}' could not be replaced (permission denied): close")
    assert hidden(out) == [LIST_NAME]
    monkeypatch.setattr(os, "replace", move)
    run_job(export(NEW, "text", out))
    assert exported(out) == NEW


def test_a_folder_that_cannot_be_written_to_is_found_before_the_old_export_is_touched(out, monkeypatch):
    def writable(folder, create=False):
        if folder.name == "tip":
            raise FileError(f"'{folder}' is read-only.")
        return writable_folder(folder, create)

    (out / "tip").mkdir()
    monkeypatch.setattr(hidden_folder, "writable_folder", writable)
    with pytest.raises(FileError, match="read-only"):
        run_job(export(NEW, "text", out))
    assert exported(out) == OLD and hidden(out) == [LIST_NAME]


def test_files_of_several_kinds_are_exchanged_together_and_those_of_one_source_are_gathered(tmp_path):
    def write_from(source, *names):
        files = hidden_folder.FileList(tmp_path)
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


def test_an_error_names_the_place_of_the_file(out, formats):
    def fail(_bake, folder, _style):
        raise FileError(f"'{folder / 'pad.csv'}' could not be written (no space left on device): free some space.")
        yield

    formats["text"] = replace(formats["text"], write=fail)
    with pytest.raises(FileError) as caught:
        run_job(export(NEW, "text", out))
    assert str(caught.value).startswith(f"'{out / 'pad.csv'}' could not be written")
    assert exported(out) == OLD and hidden(out) == [LIST_NAME]


@pytest.mark.parametrize(
    "name", ["../victim.txt", "/victim.txt", "link/victim.txt", "pad/../../victim.txt", "", ".", "a\\..\\b", "a\0b"]
)
def test_a_list_from_the_net_removes_nothing_outside_of_the_folder(out, tmp_path, name):
    (tmp_path / "victim.txt").write_text("victim")
    name = str(tmp_path / "victim.txt") if name.startswith("/") else name
    (out / "link").symlink_to(tmp_path)
    listed = {"complete": True, "files": {name: hashlib.sha256(b"victim").hexdigest()}}
    (out / LIST_NAME).write_text(json.dumps({"format": LIST_FORMAT, "exports": {"text": listed}}))
    run_job(export(NEW, "text", out))
    assert (tmp_path / "victim.txt").read_text() == "victim"
