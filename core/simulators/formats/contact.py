# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact for other engines: ``solref`` and ``solimp`` of MuJoCo, pressures of Newton, and the errors of both."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from ...io.file_writing import write_text
from ..sensor_format import SensorFormat, Written
from ..sensor_on_mesh import SensorOnMesh

CONTACT_FORMAT = "palpate-contact/1"


def write_contact(item: SensorOnMesh, path: Path, _: str) -> Written:
    """Write a JSON file."""
    from ..contact_translation import mujoco_contact, newton_contact

    mujoco, newton, file = mujoco_contact(item), newton_contact(item), Path(f"{path}.contact.json")
    content = {"format": CONTACT_FORMAT, "sensor": item.name, "mujoco": asdict(mujoco)}
    content["newton"] = asdict(newton) | {"pressure": newton.pressure.tolist()}
    write_text(file, json.dumps(content, indent=1, allow_nan=False) + "\n")
    notes = [
        f"'{item.name}' in MuJoCo: {mujoco.error}; damping: {mujoco.damping_error}.",
        f"'{item.name}' in Newton: {newton.error}.",
        *(f"'{item.name}': {note}" for note in dict.fromkeys((*mujoco.notes, *newton.notes))),
    ]
    return Written([file], notes)


FORMAT = SensorFormat(
    "contact",
    "Contact for MuJoCo and Newton (JSON)",
    "solref and solimp of MuJoCo and the pressure law of Newton, from stiffness, stiffening, damping and friction",
    write_contact,
)
