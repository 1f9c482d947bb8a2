# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever a user records is either used or refused in one sentence; no recording ends in a traceback or in NaN."""

import json

import numpy as np
import pytest
from gap_cases import diagnosed

from palpate.benchmarks._recordings import Recording
from palpate.core.errors import PalpateError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.report.summary import summary

TIME = 0.05 * np.arange(70)
RESPONSES = ("texel_0", "texel_1")


def recording(seed):
    """A press, a hold and a release of two texels that creep a little."""
    rng = np.random.default_rng(seed)
    depth = np.interp(TIME, [0.0, 0.5, 1.2, 2.5, 3.0, 3.5], [-1e-3, -1e-3, 2e-3, 2e-3, -1e-3, -1e-3])
    force = 80.0 * np.maximum(depth, 0.0) * (1.0 - 0.1 * np.clip(TIME - 0.8, 0.0, 1.0))
    return {"time": TIME, "depth": depth} | {name: force + 1e-3 * rng.normal(size=len(TIME)) for name in RESPONSES}


def responses(change):
    """A fault of all channels."""

    def act(columns):
        return columns | {name: change(columns[name]) for name in RESPONSES}

    return act


def without_contact(columns):
    return columns | {"depth": 0.0 * TIME - 1e-3} | {name: 1e-3 * np.sin(50.0 * TIME) for name in RESPONSES}


FAULTS = {
    "no contact": without_contact,
    "one press shorter than the others": lambda columns: {name: values[20:28] for name, values in columns.items()},
    "at the rail": responses(lambda values: np.clip(values, 0.0, 0.02)),
    "stuck": responses(lambda values: 0.0 * values + 0.3),
    "one empty": lambda columns: columns | {"texel_0": columns["texel_0"] * np.nan},
    "empty but three": responses(lambda values: np.where(np.arange(len(TIME)) < 3, values, np.nan)),
    "nothing but noise": responses(lambda values: np.cos(1e4 * values)),
    "huge": responses(lambda values: 1e25 * values),
    "days of pause": lambda columns: columns | {"time": TIME + 1e6 * (TIME > 2.0)},
    "nanoseconds": lambda columns: columns | {"time": 1e-9 * TIME},
    "always the same depth": lambda columns: columns | {"depth": 0.0 * TIME + 1e-3},
}
REFUSED = {"empty": responses(lambda values: values * np.nan), "the other sign": responses(lambda values: -values)}


def rig_with(folder, fault, where):
    """Two recordings to fit and one to check, of which `where` names those with a fault."""
    made = [(name, "check" if name == "c" else "fit", recording(seed)) for seed, name in enumerate("abc")]
    made = [(name, use, fault(columns) if name in where else columns) for name, use, columns in made]
    return Recording("odd", "grid = { rows = 1, columns = 2, pitch = 0.004 }\nk = 70.0", made).write(folder)


@pytest.mark.slow("a whole diagnosis of a rig with one odd recording")
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("name", "where"), [*((name, "a") for name in FAULTS), ("no contact", "c"), ("stuck", "c")])
def test_one_odd_recording_is_used(tmp_path, name, where):
    result = diagnosed(read_rig(rig_with(tmp_path, FAULTS[name], where)))
    json.dumps(summary(result, gap_errors(result)), allow_nan=False)
    assert result.verdict in ("explained", "no gap", "unexplained")


@pytest.mark.parametrize("name", [*REFUSED, "no contact", "stuck", "no response at all"])
def test_rigs_with_nothing_else_are_refused(tmp_path, name):
    fault = {**REFUSED, **FAULTS, "no response at all": responses(lambda values: 0.0 * values)}[name]
    with pytest.raises(PalpateError) as caught:
        diagnosed(read_rig(rig_with(tmp_path, fault, "abc")))
    message = str(caught.value)
    assert message.endswith((".", ")")) and "\n" not in message and len(message) < 400


def test_a_rig_of_which_nothing_is_left_to_be_fitted(tmp_path):
    """The net force is the known force: no parameter of the sensor changes a response."""
    load = np.maximum(recording(0)["depth"], 0.0)
    known = {"time": TIME, "force": 1e3 * load, "force_z": -1e3 * load + 1e-3 * np.sin(50.0 * TIME)}
    sensor = "grid = { rows = 1, columns = 2, pitch = 0.004 }\nk = 70.0"
    rig = Recording("odd", sensor, [("a", "fit", known), ("b", "check", known)]).write(tmp_path)
    result = diagnosed(read_rig(rig))
    assert result.verdict in ("explained", "no gap", "unexplained") and np.isfinite(result.best.sse).all()
