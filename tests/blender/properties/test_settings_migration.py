# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of an older version are brought forward step by step; those of a newer one are left alone."""

import pytest

from palpate.addon.properties.migrations import STEPS, VERSION, migrate
from palpate.core.errors import FileError


def renamed(settings):
    settings["k"] = settings.pop("stiffness")
    return settings


def in_metres(settings):
    return {**settings, "max_penetration": settings["max_penetration"] / 1000.0}


def test_steps_run_in_order_and_only_those_of_the_kind():
    steps = {("object", 1): renamed, ("object", 2): in_metres, ("scene", 1): lambda settings: {}}
    old = {"schema_version": 1, "stiffness": 58.4, "max_penetration": 12.0}
    assert migrate(old, "object", "Pad", steps, 3) == {"schema_version": 3, "k": 58.4, "max_penetration": 0.012}
    assert old == {"schema_version": 1, "stiffness": 58.4, "max_penetration": 12.0}


def test_a_later_start_skips_earlier_steps():
    steps = {("object", 1): renamed, ("object", 2): in_metres}
    assert migrate({"schema_version": 2, "k": 5.0, "max_penetration": 3.0}, "object", "Pad", steps, 3)["k"] == 5.0


def test_a_version_without_a_step_changes_nothing_but_its_number():
    assert migrate({"schema_version": 1, "a": 1}, "scene", "Scene", {}, 2) == {"schema_version": 2, "a": 1}


def test_settings_never_saved_need_no_step():
    assert migrate({}, "object", "Pad", {("object", 0): renamed}, 1) == {"schema_version": 1}


def test_newer_settings_are_refused_with_one_sentence():
    with pytest.raises(FileError, match=r"^The settings of 'Pad' were saved by a newer Palpate .*: install"):
        migrate({"schema_version": VERSION + 1}, "object", "Pad")


def test_every_step_leads_to_a_known_version():
    assert all(kind in ("object", "scene") and 1 <= version < VERSION for kind, version in STEPS)
