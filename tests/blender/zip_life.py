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


def is_there():
    """Whether the extension is enabled and its properties are known."""
    import addon_utils

    return [addon_utils.check(MODULE)[1], hasattr(bpy.types.Object, "palpate")]


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
    report = {}
    done = bpy.ops.extensions.package_install_files(repo="user_default", filepath=zip_path, enable_on_install=True)
    assert done == {"FINISHED"}, done
    report["enabled"] = is_there()
    files = files_of_extension()
    report["road"] = road()
    report["fonts"] = figure()
    report["written beside the source"] = sorted(set(files_of_extension()) ^ set(files))
    report["wheels"], report["compiled"] = wheels()
    bpy.ops.preferences.addon_disable(module=MODULE)
    report["disabled"], report["MPLCONFIGDIR"] = is_there(), os.environ.get("MPLCONFIGDIR")
    bpy.ops.preferences.addon_enable(module=MODULE)
    report["enabled again"] = is_there()
    repos = bpy.context.preferences.extensions.repos
    index = next(i for i, repo in enumerate(repos) if repo.module == "user_default")
    done = bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id="palpate")
    assert done == {"FINISHED"}, done
    report["uninstalled"] = is_there()
    with open(report_path, "w", encoding="utf-8") as out:
        json.dump(report, out)


main()
sys.stdout.flush()
sys.stderr.flush()
os._exit(0)  # Blender as a Python module may hang at exit, in a destructor of its own
