# SPDX-License-Identifier: GPL-3.0-or-later
"""A Debian that has no longer, or not yet, the Blender that is asked for is met with one sentence."""

from __future__ import annotations

import subprocess
from pathlib import Path

import provision_blender
import pytest


def answers(monkeypatch, **versions: str) -> None:
    """Let apt answer these candidates."""

    def run(command, **settings):
        text = f"{command[-1]}:\n  Installed: (none)\n  Candidate: {versions[command[-1]]}\n"
        return subprocess.CompletedProcess(command, 0, text, "")

    monkeypatch.setattr(provision_blender.subprocess, "run", run)
    monkeypatch.setattr(provision_blender, "mirror", lambda: "http://mirror.example/debian")


def test_the_blender_that_is_asked_for(monkeypatch):
    answers(monkeypatch, blender="5.2.2+dfsg-1", python3="3.14.1-2")
    assert provision_blender.check_candidate("5.2", Path("/")) is None


@pytest.mark.parametrize(
    ("blender", "python", "says"),
    [
        ("5.20.0-1", "3.14.1-2", "has 5.20.0-1"),
        ("(none)", "3.14.1-2", r"has \(none\)"),
        ("5.2.2-1", "3.15.0-1", "python3 3.14, .*has 3.15"),
    ],
)
def test_another_one(monkeypatch, blender, python, says):
    answers(monkeypatch, blender=blender, python3=python)
    with pytest.raises(provision_blender.ProvisionError, match=says):
        provision_blender.check_candidate("5.2", Path("/"))


def test_each_has_its_own_folder():
    folders = [provision_blender.folder(blender) for blender in provision_blender.DEBIAN]
    assert len(set(folders)) == len(folders)
