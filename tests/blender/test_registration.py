# SPDX-License-Identifier: GPL-3.0-or-later
"""Enabling is instant and disabling leaves nothing behind, also when a dependency is missing."""

import ast
import importlib.util
import re
from pathlib import Path

import bpy
import pytest
from processes import python

import palpate
from palpate.addon.properties import registration

pytestmark = pytest.mark.enabling


def kinds_of(base):
    for kind in base.__subclasses__():
        yield kind
        yield from kinds_of(kind)


def own_kinds(base):
    return [kind for kind in kinds_of(base) if kind.__module__.startswith("palpate.")]


def traces() -> dict:
    """Everything of ours that Blender knows."""
    bases = (bpy.types.Operator, bpy.types.Panel, bpy.types.Menu, bpy.types.PropertyGroup, bpy.types.AddonPreferences)
    classes = {kind for base in bases for kind in kinds_of(base)}
    handlers = bpy.app.handlers
    return {
        "classes": sorted(kind.__name__ for kind in classes if "palpate" in kind.__module__ and kind.is_registered),
        "object": hasattr(bpy.types.Object, "palpate"),
        "scene": hasattr(bpy.types.Scene, "palpate"),
        "operators": sorted(dir(bpy.ops.palpate)),
        "handlers": {
            name: sorted(function.__module__ for function in items if "palpate" in function.__module__)
            for name in dir(handlers)
            if isinstance(items := getattr(handlers, name), list)
        },
        "menus": sum(
            "palpate" in function.__module__
            for kind in {*kinds_of(bpy.types.Menu), *kinds_of(bpy.types.Panel)}
            for function in getattr(getattr(kind, "draw", None), "_draw_funcs", ())
        ),
    }


@pytest.fixture
def commands(monkeypatch):
    """Names of the command-line commands that are registered; Blender has no list of its own."""
    known = {}
    register, unregister = bpy.utils.register_cli_command, bpy.utils.unregister_cli_command

    def add(name, run):
        handle = register(name, run)
        known[id(handle)] = name
        return handle

    def remove(handle):
        del known[id(handle)]
        unregister(handle)

    palpate.unregister()
    monkeypatch.setattr(bpy.utils, "register_cli_command", add)
    monkeypatch.setattr(bpy.utils, "unregister_cli_command", remove)
    yield known
    monkeypatch.undo()
    palpate.register()


def test_disabling_leaves_nothing_and_enabling_again_works(commands):
    without = traces()
    assert not any(without[key] for key in ("classes", "object", "scene", "operators", "menus"))
    assert not any(without["handlers"].values())
    palpate.register()
    first = traces()
    assert first["object"] and first["scene"] and first["menus"] == 11
    assert "PALPATE_PT_physics" in first["classes"] and "bake" in first["operators"]
    assert list(commands.values()) == ["palpate"]
    palpate.unregister()
    assert traces() == without
    assert not commands
    palpate.register()
    assert traces() == first
    palpate.unregister()
    assert traces() == without


def test_registering_twice_is_registering_once(commands):
    without = traces()
    palpate.register()
    once = traces()
    palpate.register()
    assert traces() == once
    palpate.unregister()
    assert traces() == without


def test_a_missing_module_leaves_a_panel_that_says_so(commands, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == "trimesh" else find(name, *rest))
    without = traces()
    palpate.register()
    assert traces()["classes"] == ["PALPATE_OT_debug_info_copy", "PALPATE_PT_missing"]
    from palpate.panels.missing import PALPATE_PT_missing

    assert PALPATE_PT_missing.lost == ("trimesh",)
    from palpate.addon.session import dependencies

    assert "missing: trimesh" in dependencies.debug_info()
    assert bpy.ops.palpate.debug_info_copy() == {"FINISHED"}
    palpate.unregister()
    assert traces() == without
    monkeypatch.undo()


def test_a_failure_while_registering_is_seen_and_leaves_nothing(commands, monkeypatch):
    without = traces()
    from palpate.addon.events import handlers

    def fail():
        raise RuntimeError("broken")

    monkeypatch.setattr(handlers, "register", fail)
    with pytest.raises(RuntimeError, match="broken"):
        palpate.register()
    assert traces() == without
    monkeypatch.undo()


def test_enabling_imports_nothing_heavy():
    code = (
        "import sys, bpy, palpate; palpate.register(); palpate.unregister();"
        "print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    loaded = set(python(code, check=True, timeout=60).stdout.split())
    assert "palpate" in loaded
    assert not loaded & {"numba", "llvmlite", "scipy", "matplotlib", "trimesh", "OpenEXR", "tqdm", "tomli_w", "jinja2", "warp"}


def test_a_process_that_forgets_to_disable_still_ends():
    """Blender 4.5 as a module hangs at exit when classes are registered."""
    code = "import bpy, palpate; palpate.register(); bpy.ops.wm.read_factory_settings(use_empty=True)"
    assert python(code, timeout=60).returncode == 0


def test_a_bake_without_a_window_loads_no_panels_and_no_exporters():
    code = (
        "import sys, palpate.commands.bake, palpate.addon.bake.bake, palpate.addon.properties.registration;"
        "print(*[name for name in sys.modules if name.startswith('palpate.')])"
    )
    loaded = python(code, check=True).stdout.split()
    unwanted = ("palpate.panels", "palpate.operators", "palpate.core.export.formats", "palpate.addon.display")
    assert "palpate.addon.bake.bake_files" in loaded and len(loaded) <= 150
    assert not [name for name in loaded if name.startswith(unwanted)]


def test_no_class_mixes_made_properties_with_written_ones():
    """From Python 3.14, which Blender 5.2 of Debian has, a class with ``__annotations__`` of its own has no others."""
    for path in Path(palpate.__file__).parent.glob("addon/**/*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                given = [target.id for part in node.body if isinstance(part, ast.Assign) for target in part.targets]
                written = any(isinstance(part, ast.AnnAssign) for part in node.body)
                assert not (written and "__annotations__" in given), f"{path.name}: {node.name}"


def test_every_operator_and_panel_has_a_name_and_a_tooltip():
    for kind in (*own_kinds(bpy.types.Operator), *own_kinds(bpy.types.Panel), *own_kinds(bpy.types.Menu)):
        assert kind.bl_label
    for kind in own_kinds(bpy.types.Operator):
        assert kind.__doc__, kind
        room, name = kind.bl_idname.split(".")
        assert "\n" not in getattr(getattr(bpy.ops, room), name).get_rna_type().description, kind
        assert kind.__name__ == f"{room.upper()}_OT_{name}"
    for group in (bpy.types.Object.bl_rna, bpy.types.Scene.bl_rna):
        for item in group.properties["palpate"].fixed_type.properties:
            assert item.is_hidden or item.identifier in ("rna_type", "name") or item.description, item.identifier


CHANGE_NOTHING = {
    "palpate.preset_add",  # writes a file
    "palpate.gap_find",
    "palpate.gap_report",
    "palpate.openrave_export",
    "palpate.sensor_toml_export",
    "palpate.sensor_export",
    "palpate.catch_up",
    "palpate.figures_make",
    "palpate.debug_info_copy",
    "palpate.study_write",
    "palpate.study_run",
    "palpate.study_report",
}


def test_every_operator_that_changes_the_scene_can_be_undone():
    """A new operator is undoable, or is named here as one that only writes files, looks or computes."""
    without = {kind.bl_idname for kind in own_kinds(bpy.types.Operator) if "UNDO" not in getattr(kind, "bl_options", ())}
    assert without == CHANGE_NOTHING


def test_every_icon_exists(repository):
    """A panel with a wrong icon fails only when it is drawn, in a window."""
    known = bpy.types.UILayout.bl_rna.functions["operator"].parameters["icon"].enum_items.keys()
    for file in (repository / "panels").glob("*.py"):
        for name in re.findall(r'icon="(\w+)"', file.read_text(encoding="utf-8")):
            assert name in known, f"{file.name}: {name}"


def test_every_number_with_a_unit_says_it_in_its_tooltip():
    """A name as in "Stiffness k (N/m)" may be cut off where it is drawn; what it says when the mouse rests on it is not."""
    owners = [cls.bl_rna for cls in registration.CLASSES]
    owners += [getattr(bpy.ops.palpate, name).get_rna_type() for name in dir(bpy.ops.palpate)]
    counted = 0
    for rna in owners:
        for item in rna.properties:
            unit = re.search(r"\(([^)×]+)\)$", item.name)
            if unit and item.type in {"FLOAT", "INT"}:
                counted += 1
                assert unit.group(1) in item.description, f"{rna.identifier}.{item.identifier}: {item.description}"
    assert counted > 60
