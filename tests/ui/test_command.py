# SPDX-License-Identifier: GPL-3.0-or-later
"""`blender --command palpate …` in a real Blender, with nothing but the extension and its wheels."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [(["--help"], 0, "bake"), (["bake", "no-such-scene.blend"], 1, "no-such-scene.blend"), (["bake"], 2, "usage")],
)
def test_command(real_blender, tmp_path, arguments, status, says):
    log = tmp_path / "command.log"
    code = real_blender.run(["blender", "--command", "palpate", *arguments], log, timeout=120)
    text = log.read_text(encoding="utf-8")
    assert code == status, text
    assert says in text
    assert "Traceback" not in text, text
