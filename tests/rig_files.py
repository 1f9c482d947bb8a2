# SPDX-License-Identifier: GPL-3.0-or-later
"""A small rig as files, whose recordings a test replaces."""

import numpy as np
import pytest

from palpate.core.errors import PalpateError
from palpate.core.gap.dataset.rig import read_rig

TEXELS = 6
RIG = """
format = "palpate-rig/1"
name = "pad under a ball"
[sensor]
grid = { rows = 3, columns = 2, pitch = [0.003, 0.004] }
thickness = 0.006
k = 80.0
[indenter]
shape = { sphere = 0.008 }
[[trial]]
file = "press.csv"
[[trial]]
file = "again.csv"
use = "check"
"""


def table(samples=20, names=("x", "y", "z"), texels=TEXELS, start=0.0):
    """A CSV as a list of rows of words, header first."""
    time = start + 0.02 * np.arange(samples)
    stimulus = {
        "x": 0.0 * time,
        "y": 0.0 * time,
        "z": 0.009 - 0.1 * time / max(samples, 1),
        "depth": 0.001 * time,
        "force": time,
    }
    header = ["time", *names, *(f"texel_{i}" for i in range(texels))]
    columns = [time, *(stimulus.get(name, 0.0 * time) for name in names), *(0.1 * time + i for i in range(texels))]
    return [header, *([f"{value:.9g}" for value in row] for row in zip(*columns, strict=True))]


def write(folder, rig=RIG, **files):
    """Write a rig with two recordings, of which `files` replaces some; return its path."""
    for name, rows in {"press": table(), "again": table(), **files}.items():
        text = rows if isinstance(rows, str) else "\n".join(",".join(row) for row in rows) + "\n"
        (folder / f"{name}.csv").write_text(text)
    path = folder / "rig.toml"
    path.write_text(rig)
    return path


def refusal(folder, rig=RIG, **files):
    """Write a rig that is refused; return the sentence that says why."""
    with pytest.raises(PalpateError) as caught:
        read_rig(write(folder, rig, **files))
    message = str(caught.value)
    assert message.endswith(".") and "\n" not in message and len(message) < 400
    return message
