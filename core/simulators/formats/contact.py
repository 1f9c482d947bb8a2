# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact for other engines: ``solref`` and ``solimp`` of MuJoCo, pressures of Newton, and the errors of both."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from ...io.bake_folder import folder_names
from ...io.file_writing import atomic_write
from ..sensor_format import SensorFormat, Written
from ..sensor_on_mesh import SensorOnMesh

CONTACT_FORMAT = "palpate-contact/1"


def write_contacts(sensors: Sequence[SensorOnMesh], folder: Path) -> Written:
    """Write one JSON file per sensor."""
    from ..contact_translation import mujoco_contact, newton_contact

    files, notes = [], []
    for item, stem in zip(sensors, folder_names(item.name for item in sensors).values(), strict=True):
        mujoco, newton = mujoco_contact(item), newton_contact(item)
        content = {"format": CONTACT_FORMAT, "sensor": item.name, "mujoco": asdict(mujoco)}
        content["newton"] = asdict(newton) | {"pressure": newton.pressure.tolist()}
        files.append(folder / f"{stem}.contact.json")
        with atomic_write(files[-1]) as temporary:
            temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        notes.append(f"'{item.name}' in MuJoCo: {mujoco.error}; damping: {mujoco.damping_error}.")
        notes.append(f"'{item.name}' in Newton: {newton.error}.")
        notes += [f"'{item.name}': {note}" for note in dict.fromkeys((*mujoco.notes, *newton.notes))]
    return Written(files, notes)


FORMAT = SensorFormat(
    "contact",
    "Contact for MuJoCo and Newton (JSON)",
    "solref and solimp of MuJoCo and the pressure law of Newton, from stiffness, stiffening, damping and friction",
    write_contacts,
)
