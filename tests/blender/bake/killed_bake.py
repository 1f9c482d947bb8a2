# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake a .blend, slowly; run by test_resume.py in a process of its own, which kills it.

python killed_bake.py SCENE.blend REPORT.json
"""

import json
import sys
from pathlib import Path

import bpy

import palpate

palpate.register()
from palpate.addon.bake import bake_checkpoint  # noqa: E402
from palpate.addon.bake.bake import bake  # noqa: E402
from palpate.core.jobs.job_runner import run_job  # noqa: E402

bake_checkpoint.CHECKPOINT_INTERVAL, bake_checkpoint.MAX_COST_SHARE = 0.0, float("inf")
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
computed = []


def note(progress) -> None:
    if progress.stage == "Computing forces":
        computed.append(progress.frame)
        print(progress.frame, flush=True)


run_job(bake(bpy.context.scene), note)
bpy.ops.wm.save_mainfile()
Path(sys.argv[2]).write_text(json.dumps(computed))
