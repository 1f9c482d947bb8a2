# SPDX-License-Identifier: GPL-3.0-or-later
"""The attack's own instruments see what they are to see, and a short, seeded part of each area finds nothing."""

import errno
import io
import json
import os
import random
import threading

import numpy as np
import pytest

from palpate.attack import (
    commands,
    damaged_logs,
    damaged_sensors,
    faults,
    imports,
    kills,
    logs,
    numbers,
    power_cut,
    readers,
    sweep,
    trees,
    unfinished_bakes,
)
from palpate.attack.__main__ import AREAS, attack, main
from palpate.attack.area import CLEAR, LOST, TRACEBACK, WRONG, Area, Case, Outcome, Tally
from palpate.attack.injector import DONE, KILL, Injector, Stopped
from palpate.attack.jobs import JOBS

SEED = 4
JOB = {job.name: job for job in JOBS}


# --- a short part of each area


def found_by(area: Area, tmp_path):
    """Run an area; return how many cases it tried and what it found, in words."""
    tally = attack(area, Tally(type(area).__name__, SEED, area.tries, tmp_path / "findings"))
    findings = [json.loads(path.read_text())["seen"] for path in (tmp_path / "findings").rglob("finding.json")]
    return sum(tally.counts.values()), findings


def scratch(tmp_path):
    (tmp_path / "scratch").mkdir()
    return tmp_path / "scratch"


@pytest.mark.long("a short attack")
def test_faults(tmp_path):
    area = faults.Faults(SEED, 14, scratch(tmp_path), (JOB["bake"], JOB["export npz"]))
    assert found_by(area, tmp_path) == (14, [])


@pytest.mark.long("a short attack")
def test_power_cuts(tmp_path):
    area = power_cut.PowerCut(SEED, 6, scratch(tmp_path), (JOB["bake"],))
    assert found_by(area, tmp_path) == (6, [])


@pytest.mark.long("a short attack")
def test_kills(tmp_path):
    area = kills.Kills(SEED, 1, scratch(tmp_path), (JOB["bake"],))
    assert found_by(area, tmp_path) == (1, [])


@pytest.mark.long("a short attack")
def test_readers(tmp_path):
    tried, findings = found_by(readers.Readers(SEED, 120, scratch(tmp_path)), tmp_path)
    assert tried >= 100 and findings == []


@pytest.mark.long("a short attack")
@pytest.mark.parametrize("area", [logs.Logs, imports.Imports])
def test_logs_and_sensors_of_other_programs(tmp_path, area):
    tried, findings = found_by(area(SEED, 90, scratch(tmp_path)), tmp_path)
    assert tried >= 85 and findings == []


def test_logs_that_are_not_damaged_become_rigs(tmp_path):
    """Otherwise the area would only try what refuses everything."""
    good = {"log.csv": damaged_logs.TABLE.encode(), "log.npz": damaged_logs.arrays_npz()}
    good |= {"log.mat": damaged_logs.arrays_mat(True), "log.h5": damaged_logs.arrays_hdf5(True)}
    good |= {"log.mcap": damaged_logs.json_mcap(True), **damaged_logs.ros_bag("bag"), **damaged_logs.ros_bag("db3")}
    for name, content in good.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    for name in ("log.csv", "log.npz", "log.mat", "log.h5", "log.mcap", "log.bag", "log"):
        damaged_logs.use(name, tmp_path)
        rig = tmp_path / "rig" / "rig.toml"
        assert rig.is_file(), name
        rig.unlink()
    for name, reader in damaged_sensors.readers().items():
        assert reader.name == name
    for kind, ending in (("mjcf", ".xml"), ("urdf", ".urdf"), ("probes", ".json")):
        for name, content in damaged_sensors.exported(kind, ending).items():
            (tmp_path / name).write_bytes(content)
        damaged_sensors.read(f"Pad{ending}", tmp_path)


@pytest.mark.long("a short attack")
def test_commands(tmp_path):
    area = commands.Commands(SEED, 20, scratch(tmp_path), disks=False, scenes=4)
    assert found_by(area, tmp_path) == (20, [])


@pytest.mark.long("a short attack")
def test_sweep(tmp_path):
    """Faults alone; kills start Dask several times and are left to `make attack`."""
    area = sweep.Sweep(SEED, 12, scratch(tmp_path), disks=False, with_kills=False)
    assert found_by(area, tmp_path) == (12, [])


@pytest.mark.long("a short attack")
def test_numbers(tmp_path):
    assert found_by(numbers.Numbers(SEED, 12, scratch(tmp_path)), tmp_path) == (12, [])


# --- instruments


@pytest.mark.parametrize("name", AREAS)
def test_every_area_has_its_size(name):
    area = __import__(f"palpate.attack.{name}", fromlist=["AREA"]).AREA
    assert issubclass(area, Area) and 0 < area.short < area.long


def test_the_whole_attack_is_as_large_as_it_says():
    """At least 500 faults, and at least 5,000 inputs in all."""
    assert faults.Faults.long >= 500
    assert sum(area.long for area in (faults.Faults, readers.Readers, commands.Commands)) >= 5000


class Planted(Area):
    """An area that finds one thing of each kind."""

    def cases(self):
        return iter([Case(kind, {"what": kind}) for kind in (CLEAR, TRACEBACK, WRONG, LOST)])

    def attempt(self, case):
        (self.folder / "evidence").write_text(case.name)
        return Outcome(case.name, f"planted {case.name}", (self.folder / "evidence",))


def test_findings_are_counted_and_kept(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(numbers, "AREA", Planted)
    assert main(["numbers", "--seed", "5", "--tries", "4", "--out", str(tmp_path)]) == 1
    line = json.loads(capsys.readouterr().out)
    assert line == {"area": "numbers", "tried": 4, "clear": 1, "traceback": 1, "wrong": 1, "lost": 1, "hung": 0}
    kept = sorted((tmp_path / "numbers").iterdir())
    assert [path.name.partition("-")[2] for path in kept] == [TRACEBACK, WRONG, LOST]
    finding = json.loads((kept[0] / "finding.json").read_text())
    assert finding["repeat"] == "python -m attack numbers --seed 5 --tries 4 --case traceback"
    assert (kept[0] / "evidence").read_text() == TRACEBACK


def test_one_case_alone_can_be_repeated(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(numbers, "AREA", Planted)
    assert main(["numbers", "--out", str(tmp_path), "--case", CLEAR]) == 0
    assert json.loads(capsys.readouterr().out)["tried"] == 1


def work(folder):
    """Make, write, synchronise and rename a file."""
    (folder / "new").mkdir()
    with open(folder / "new" / "file", "wb") as file:
        file.write(b"0123456789")
        file.flush()
        os.fsync(file.fileno())
    (folder / "new" / "file").rename(folder / "file")
    (folder / "new").rmdir()


@pytest.mark.parametrize("damage", ["none", "a number", "a number, vouched for"])
def test_unfinished_bakes_are_damaged_and_judged(damage, tmp_path):
    """Undamaged, it goes on and says nothing; a changed number is told by its checksum, and believed with a new one."""
    files = dict(unfinished_bakes.unfinished())
    state = next(path for path in files if path.endswith("state.npz"))
    if damage != "none":
        with np.load(io.BytesIO(files[state])) as members:
            arrays = {name: members[name] for name in members.files}
        key = json.loads(str(arrays["tree"]))["object"]["_state"]["fields"]["position"]["array"]
        arrays[key][1, 2] += 0.001
        file = io.BytesIO()
        np.savez(file, **arrays)
        files[state] = file.getvalue()
    if damage.endswith("vouched for"):
        files[state] = unfinished_bakes.with_checksums(files, state)
    for path, content in files.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_bytes(content)
    notes = unfinished_bakes.bake(tmp_path / "bake")
    told = "its state does not have its checksum" in "".join(notes)
    assert (len(notes), told) == ((1, True) if damage == "a number" else (0, False))
    same = (tmp_path / "bake/pad/recording.npz").read_bytes() == unfinished_bakes.whole()["bake/pad/recording.npz"]
    assert same == (damage != "a number, vouched for")


def test_every_operation_is_counted_and_none_outside(tmp_path):
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir(), outside.mkdir()
    with Injector(inside) as injector:
        work(outside)
        work(inside)
    assert injector.calls == ["mkdir new", "open new/file", "write new/file", "fsync new/file", "rename file", "rmdir new"]
    assert sorted(path.name for path in inside.iterdir()) == ["file"]


@pytest.mark.parametrize("at", range(1, 7))
def test_a_kill_lets_nothing_happen_any_more(tmp_path, at):
    with Injector(tmp_path, at, KILL), pytest.raises(Stopped):
        work(tmp_path)
    with Injector(tmp_path, 1, KILL):
        with pytest.raises(Stopped):
            (tmp_path / "a").mkdir()
        with pytest.raises(Stopped):
            (tmp_path / "b").write_text("")
    content = (tmp_path / "new" / "file").read_bytes() if (tmp_path / "new" / "file").exists() else None
    assert content == {1: None, 2: None, 3: b"01234", 4: b"0123456789", 5: b"0123456789", 6: None}[at]


def test_errors_and_lost_answers(tmp_path):
    with Injector(tmp_path, 1, "ENOSPC"), pytest.raises(OSError) as caught:
        (tmp_path / "a").mkdir()
    assert caught.value.errno == errno.ENOSPC and not (tmp_path / "a").exists()
    with Injector(tmp_path, 1, DONE), pytest.raises(OSError):
        (tmp_path / "a").mkdir()
    assert (tmp_path / "a").exists()


def test_nothing_stays_wrapped(tmp_path):
    before = os.rename, os.open, open, threading.Thread.start
    with Injector(tmp_path, 1, KILL), pytest.raises(Stopped):
        work(tmp_path)
    assert before == (os.rename, os.open, open, threading.Thread.start)


def test_a_cut_loses_what_was_not_synchronised(tmp_path):
    contents = tmp_path / "contents"
    contents.mkdir()
    for name in ("old", "new"):
        (contents / name).write_text(name)
    moment = {"operation": "x", "folders": [], "synced_names": ""}
    moments = [
        {**moment, "files": {"a": [1, "old"]}, "durable": {"1": "old"}, "synced_names": "all"},
        {**moment, "files": {"a": [1, "new"], "b": [2, "new"]}, "durable": {"1": "old"}},
        {**moment, "files": {"a": [1, "new"], "b": [2, "new"]}, "durable": {"1": "new", "2": "new"}, "synced_names": "all"},
    ]
    (tmp_path / "moments.json").write_text(json.dumps(moments))
    recorded = power_cut.Recorded(tmp_path / "moments.json")
    seen = set()
    for seed in range(60):
        place = tmp_path / f"place {seed}"
        place.mkdir()
        recorded.cut(1, random.Random(seed), place)
        seen.add(tuple(sorted((path.name, path.read_text()) for path in place.iterdir())))
    older, newer = {dict(one)["a"] for one in seen}, {dict(one).get("b") for one in seen}
    assert older == {"old", "n", "\0\0\0", "new"} and newer == {None, "", "n", "\0\0\0", "new"}
    (tmp_path / "last").mkdir()
    recorded.cut(2, random.Random(1), tmp_path / "last")
    assert {path.name: path.read_text() for path in (tmp_path / "last").iterdir()} == {"a": "new", "b": "new"}


def test_trees_are_compared_and_put_back(tmp_path):
    kept, place = tmp_path / "kept", tmp_path / "place"
    (kept / "folder").mkdir(parents=True)
    (kept / "file").write_text("1")
    (kept / "link").symlink_to("nowhere")
    trees.put_back(kept, place)
    before = trees.tree(place)
    assert before == trees.tree(kept) and before["folder"] == trees.FOLDER
    (place / "file").write_text("2")
    (place / "more").write_text("")
    (place / "folder").rmdir()
    assert trees.differences(before, trees.tree(place)) == "+more, -folder, ≠file"
    trees.put_back(kept, place)
    assert trees.differences(before, trees.tree(place)) == ""


@pytest.mark.parametrize(
    ("after", "words", "status", "kind"),
    [
        ({"a": "1"}, ("export", "palpate"), 1, LOST),
        ({"a": "2", "notes.txt": "1"}, ("export", "palpate"), 0, LOST),
        ({"a": "2", "notes.txt": "1"}, ("bake", "a"), 1, LOST),
        ({"a": "2", "notes.txt": "1"}, ("bake", "a"), 0, None),
        ({"a": "1", "notes.txt": "1", ".a.0123abcd.partial": "1"}, ("bake", "a"), 0, WRONG),
        ({"a": "1", "notes.txt": "1", commands.MARK_OF_SCRIPTS: "folder"}, ("bake", "a"), 0, WRONG),
        ({"a": "1", "notes.txt": "1"}, ("bake", "a"), 1, None),
    ],
)
def test_what_commands_do_to_files_is_judged(after, words, status, kind):
    outcome = commands.judge_files({"a": "1", "notes.txt": "1"}, after, words, {"status": status})
    assert (outcome and outcome.kind) == kind


@pytest.mark.parametrize(
    ("printed", "status", "kind"),
    [
        ("palpate bake: There is no file 'x': check its name and folder.\n", 1, None),
        ("", 1, WRONG),
        ("palpate bake: One.\npalpate bake: Two.\n", 1, WRONG),
        ("Traceback (most recent call last):\n  ...\nValueError\n", 1, TRACEBACK),
        ("done\n", 0, None),
        ("usage: palpate [-h] COMMAND ...\n", 2, None),
        ("usage: palpate [-h] COMMAND ...\n", 1, WRONG),
        ("", None, WRONG),
    ],
)
def test_what_commands_say_is_judged(printed, status, kind):
    outcome = commands.judge_words({"printed": printed, "status": status, "traceback": ""})
    assert (outcome and outcome.kind) == kind
