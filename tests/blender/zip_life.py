# SPDX-License-Identifier: GPL-3.0-or-later
"""The life of the extension in a fresh Blender, run by test_zip.py in a process of its own.

python -I -S zip_life.py FOLDER_WITH_BPY_ONLY ZIP REPORT.json
"""

import json
import os
import sys

only_blender, zip_path, report_path = sys.argv[1:]
sys.path.insert(0, only_blender)

import bpy  # noqa: E402

MODULE = "bl_ext.user_default.palpate"
commands = []


def watch_commands():
    """Blender has no list of its command line's commands, so they are counted as they come and go."""
    register, unregister = bpy.utils.register_cli_command, bpy.utils.unregister_cli_command
    names = {}

    def counted_register(name, execute):
        handle = register(name, execute)
        names[id(handle)] = (name, handle)
        commands.append(name)
        return handle

    def counted_unregister(handle):
        if id(handle) in names:  # Blender's own command was registered before the watch began
            commands.remove(names.pop(id(handle))[0])
        return unregister(handle)

    bpy.utils.register_cli_command, bpy.utils.unregister_cli_command = counted_register, counted_unregister


def ours(thing):
    return "palpate" in getattr(thing, "__module__", "").split(".")


def every_class(base):
    for kind in base.__subclasses__():
        yield kind
        yield from every_class(kind)


def state():
    """Everything an add-on can leave behind."""
    import addon_utils

    bases = [bpy.types.Operator, bpy.types.Panel, bpy.types.Menu, bpy.types.Header, bpy.types.UIList]
    bases += [bpy.types.PropertyGroup, bpy.types.AddonPreferences]
    kinds = {kind for base in bases for kind in every_class(base)}
    drawn = [bpy.types.Menu, bpy.types.Panel, bpy.types.Header]
    # only ours: Blender moves a menu's own function into its list when the first entry is appended, and leaves it there
    menu_entries = sum(
        ours(entry)
        for base in drawn
        for kind in set(every_class(base))
        for entry in getattr(getattr(kind, "draw", None), "_draw_funcs", [])
    )
    lists = {name: value for name in dir(bpy.app.handlers) if isinstance(value := getattr(bpy.app.handlers, name), list)}
    keymaps = bpy.context.window_manager.keyconfigs.addon
    return {
        "is_enabled": addon_utils.check(MODULE)[1],
        "has_properties": hasattr(bpy.types.Object, "palpate"),
        "commands": list(commands),
        "classes": sorted(kind.__name__ for kind in kinds if ours(kind) and kind.is_registered),
        "menu_entries": menu_entries,
        "handlers": {name: sorted(f"{f.__module__}.{f.__name__}" for f in value) for name, value in lists.items()},
        "keymap_items": sum(len(keymap.keymap_items) for keymap in keymaps.keymaps) if keymaps else 0,
        "modules": sorted({name.partition(".")[0] for name in sys.modules}),
    }


def wheels():
    """Where each heavy module comes from, and the sum that numba compiled."""
    import jinja2
    import markupsafe
    import matplotlib
    import numba
    import tomli_w
    import tqdm
    import trimesh

    @numba.njit
    def total(n):
        result = 0
        for i in range(n):
            result += i
        return result

    return {m.__name__: m.__file__ for m in (jinja2, markupsafe, matplotlib, numba, tomli_w, tqdm, trimesh)}, total(10)


def road():
    """Make a sensor, press it, play it, bake it, with nothing but what the zip brought."""
    from pathlib import Path

    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=5, y_subdivisions=13, size=0.05)
    pad = bpy.context.object
    bpy.ops.palpate.sensor_add(source="MESH")
    pad.palpate.k = 1000.0
    pad.palpate.cn = 10.0
    bpy.ops.mesh.primitive_cube_add(size=0.06, location=(0.0, 0.0, 0.0301))
    bpy.ops.palpate.role_set(role="TARGET")
    bpy.context.object.palpate.body = "FREE"
    scene = bpy.context.scene
    scene.frame_end = 20
    folder = Path(report_path).parent / "project"
    folder.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    for frame in range(1, 21):
        scene.frame_set(frame)
    played = sum(value.value for value in pad.data.attributes["palpate_force"].data)
    bpy.ops.palpate.bake()
    files = sorted(path.name for path in (folder / "palpate-bake" / pad.name).iterdir())
    archive = sys.modules[f"{MODULE}.core.io.recording_npz"]
    recording = archive.load_recording(folder / "palpate-bake" / pad.name / "recording.npz")
    kernels = sys.modules[f"{MODULE}.core.compiled.kernels"].KERNELS
    compiled = Path(bpy.utils.extension_path_user(MODULE, path="numba")).rglob("*.nbi")
    return {
        "played": played,
        "baked": float(recording.sensors[pad.name].normal_force[-1].sum()),
        "files": files,
        "compiled": len(list(compiled)),
        "loaded": sum(sum(kernel.stats.cache_hits.values()) for kernel in kernels),
        "compiled here": sorted(kernel.__name__ for kernel in kernels if sum(kernel.stats.cache_misses.values())),
    }


def files_of_extension():
    """What is in the extension's own folder, where it must not write; Python's byte code is Python's."""
    from pathlib import Path

    root = Path(sys.modules[MODULE].__file__).parent
    files = [path for path in root.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    return sorted((path.relative_to(root).as_posix(), path.stat().st_size) for path in files)


def figure():
    """Draw a figure, for which matplotlib looks for fonts and keeps their list."""
    from pathlib import Path

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawn = Figure()
    drawn.text(0.5, 0.5, "N")
    FigureCanvasAgg(drawn).draw()
    return sorted(path.name for path in Path(bpy.utils.extension_path_user(MODULE, path="matplotlib")).iterdir())


def main():
    watch_commands()
    report = {"before": state()}
    done = bpy.ops.extensions.package_install_files(repo="user_default", filepath=zip_path, enable_on_install=True)
    assert done == {"FINISHED"}, done
    report["enabled"] = state()
    files = files_of_extension()
    report["road"] = road()
    report["fonts"] = figure()
    report["written beside the source"] = sorted(set(files_of_extension()) ^ set(files))
    report["wheels"], report["compiled"] = wheels()
    bpy.ops.preferences.addon_disable(module=MODULE)
    report["disabled"] = state() | {"MPLCONFIGDIR": os.environ.get("MPLCONFIGDIR")}
    bpy.ops.preferences.addon_enable(module=MODULE)
    report["enabled_again"] = state()
    repos = bpy.context.preferences.extensions.repos
    index = next(i for i, repo in enumerate(repos) if repo.module == "user_default")
    done = bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id="palpate")
    assert done == {"FINISHED"}, done
    report["uninstalled"] = state()
    with open(report_path, "w", encoding="utf-8") as out:
        json.dump(report, out)


main()
sys.stdout.flush()
sys.stderr.flush()
os._exit(0)  # Blender as a Python module may hang at exit, in a destructor of its own
