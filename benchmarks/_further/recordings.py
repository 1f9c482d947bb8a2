# SPDX-License-Identifier: GPL-3.0-or-later
"""The further recordings as rigs. Whole recordings are held out: another speed, another depth, another day."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from palpate.benchmarks._recordings import Columns, Recording, thinned

LENGTH = 0.08
"""Length of the polymer's strip at rest, m."""
SAMPLE = 0.057
"""Seconds between samples of the microfluidic sensor: what the way and speed of its presses say about their lengths."""
PLACES = (-15.0, 0.0, 15.0)
"""Where the microfluidic sensor is pressed, mm."""


def polymer(data: Path) -> Recording:
    """Force (N) of a strip over its elongation (m): two rates and a relaxation fitted, another rate and stretch held out."""
    pull, hold = "uniaxial-loading-unloading/original_data", "single-step-relaxation/original_data"
    wanted = ((f"{pull}/0d01_3d0", "fit", 20), (f"{pull}/0d05_2d0", "fit", 4), (f"{hold}/2d0", "fit", 5))
    wanted += ((f"{pull}/0d03_2d5", "check", 5), (f"{hold}/2d5", "check", 5))
    trials: list[tuple[str, str, Columns]] = []
    for path, use, by in wanted:
        lines = (data / f"{path}.csv").read_text(encoding="latin-1").replace('"', "").splitlines()[2:]
        table = np.array([[float(cell) for cell in line.split(",")[:3]] for line in lines if line[:1].isdigit()])
        table = thinned(table[table[:, 0] < 120.0] if hold in path else table, by)
        table = table[np.append(True, np.diff(table[:, 0]) > 0)]
        name = "hold_" * (hold in path) + Path(path).name
        columns = {"time": table[:, 0], "depth": np.maximum(table[:, 1], 0.0) * 1e-3, "texel_0": table[:, 2]}
        trials.append((name, use, columns))
    words = "grid = { rows = 1, columns = 1, pitch = 0.01 }\nk = 15.0\ncn = 0.0\nmax_penetration = 0.5"
    return Recording("stretched polymer", words, trials)


def polymer_strip(data: Path) -> Recording:
    """The same over what the stress of a strip of constant volume is proportional to (neo-Hooke), equal for small strains."""
    plain = polymer(data)
    trials: list[tuple[str, str, Columns]] = []
    for name, use, columns in plain.trials:
        stretch = 1.0 + columns["depth"] / LENGTH
        trials.append((name, use, columns | {"depth": (stretch - stretch**-2.0) * LENGTH / 3.0}))
    return replace(plain, name="stretched polymer, as a strip", trials=trials)


def velostat(data: Path) -> Recording:
    """Conductance (1/kΩ) of two films under 22 known weights, each put on for 15 s, by the clock of the day.

    The films are specimens. What lies between two weights was not recorded: nothing is on the film then.
    """
    folder = data / "src/experimental_data/archive"
    trials: list[tuple[str, str, Columns]] = []
    for name, use in (("old_1", "fit"), ("new_1", "fit"), ("old_2", "check")):
        rows: list[tuple[float, float, float]] = []
        for number in range(22):
            path = folder / f"velostat_data_for_calibration_{name}_good" / f"experiment_{number}.txt"
            lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
            table = thinned(np.array([[float(cell) for cell in line[:3]] for line in lines if len(line) >= 3]), 60)
            if rows:  # a sample every two seconds tells that the film is free
                rows += [(time, 0.0, np.nan) for time in np.arange(rows[-1][0] + 0.5, table[0, 1] - 0.5, 2.0)]
            rows += [(time, 9.81 * kilograms, 1.0 / ohms) for ohms, time, kilograms in table.tolist()]
        whole = np.array(rows)
        columns = {"time": whole[:, 0] - whole[0, 0], "force": whole[:, 1], "texel_0": whole[:, 2]}
        trials.append((name, use, columns))
    words = 'grid = { rows = 1, columns = 1, pitch = 0.01 }\nunit = "1/kOhm"'
    return Recording("piezoresistive film", words, trials, 'factor = "free"')


BAROMETER_TRIALS = (
    ("zv1_zd6_t0_20230622_180037", "fit"),
    ("zv05_zd5_t8_20230622_185843", "fit"),
    ("zv1_zd5_t8_20230622_181736", "check"),
    ("zv05_zd6_t8_20230622_185108", "check"),
)
"""Recordings of the barometers: speed and depth of the presses, and how long they were held."""


def _barometer_table(data: Path, name: str, by: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times (s), places along the tip (m), ways down (m) and pressures (kPa) over those at rest, of four barometers.

    480 steps of the vertical axis are a millimetre, as are 1000 of the horizontal one.
    """
    table = np.genfromtxt(data / "Data_collection" / "tip1" / f"{name}.csv", delimiter=",", skip_header=1)
    table = thinned(table[np.append(True, np.diff(table[:, 6]) > 0)], by)
    return table[:, 6], table[:, 4] * 1e-6, table[:, 5] / 480.0e3, (table[:, :4] - np.median(table[:20, :4], axis=0)) * 1e-3


def barometers(data: Path) -> Recording:
    """Pressures (kPa) of four barometers under a cover that is pressed at twenty places.

    Neither the probe nor the height at which it touches is said: a ball of 4 mm is assumed, and contact at 3.4 mm.
    """
    trials: list[tuple[str, str, Columns]] = []
    for name, use in BAROMETER_TRIALS:
        time, along, down, pressure = _barometer_table(data, name, 6)
        columns = {"time": time, "x": along - 0.00325, "y": np.zeros_like(along), "z": 0.0074 - down}
        trials.append((name[: name.index("_2023")], use, columns | {f"texel_{i}": p for i, p in enumerate(pressure.T)}))
    places = ", ".join(f"[{x}, 0.0]" for x in (-0.00975, -0.00325, 0.00325, 0.00975))
    words = f'sensors = [{places}]\ncover = {{ size = [0.03, 0.012], depth = 0.004, pitch = 0.0015 }}\nunit = "kPa"\n'
    words += 'k = 500.0\ncontact_height = "free"\n[indenter]\nshape = { sphere = 0.004 }'
    return Recording("barometers under a cover", words, trials)


def barometer(data: Path) -> Recording:
    """Pressure (kPa) of the third barometer over the depth, in the presses next to it."""
    trials: list[tuple[str, str, Columns]] = []
    for name, use in BAROMETER_TRIALS:
        time, along, down, pressure = _barometer_table(data, name, 2)
        here = np.abs(along - 0.006) < 2e-4
        columns = {"time": time[here] - time[here][0], "depth": np.maximum(down[here] - 0.0025, 0.0)}
        trials.append((name[: name.index("_2023")], use, columns | {"texel_0": pressure[here, 2]}))
    words = 'grid = { rows = 1, columns = 1, pitch = 0.0065 }\nunit = "kPa"\ncontact_height = "free"\nmax_penetration = 0.01'
    return Recording("one barometer, at one place", words, trials)


def joint(data: Path) -> Recording:
    """Friction torque (N m, taken as newtons) over the angle (rad, taken as metres) of travel, with a bias of its own."""
    trials: list[tuple[str, str, Columns]] = []
    for speed, use in (("slow", "fit"), ("high", "fit"), ("middle", "check")):
        path = data / "Comparative data" / "Franka Robot" / f"case4_{speed}.csv"
        table = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=range(5))
        table = thinned(table[np.append(True, np.diff(table[:, 0]) > 0)], 8)
        columns = {"time": table[:, 0] - table[0, 0], "depth": np.full(len(table), 1e-3)}
        trials.append((speed, use, columns | {"slide_x": table[:, 1] - table[0, 1], "force_x": table[:, 4]}))
    words = "grid = { rows = 1, columns = 1, pitch = 0.05 }\nk = 300.0\nmax_penetration = 0.1"
    return Recording("robot joint", words, trials, 'force_zero = "free"')


def microfluidic(data: Path) -> Recording:
    """Voltage over the force of presses at three places, each with a channel of its own, as they have other gains.

    Forty presses at 1, 3 and 5 mm/s are one recording; held out are those at 2 and 4 mm/s, and others of any speed and depth.
    """
    names = ("trial", "x_location", "z_location", "speed", "voltage", "force")
    tables = {}
    for name in ("train", "test"):
        read = np.genfromtxt(data / "data" / f"loc_{name}.csv", delimiter=",", names=True)
        tables[name] = np.column_stack([read[column] for column in names])
    odd, even = (np.isin(tables["train"][:, 3], speeds) for speeds in ((1, 3, 5), (2, 4)))
    chosen = (("odd_1", "fit", tables["train"][odd], 0), ("odd_2", "fit", tables["train"][odd], 7))
    chosen += (("even", "check", tables["train"][even], 0), ("any", "check", tables["test"], 0))
    trials = [(name, use, _presses(table, first)) for name, use, table, first in chosen]
    return Recording("microfluidic sensor", 'grid = { rows = 1, columns = 3, pitch = 0.015 }\nunit = "V"', trials)


def _presses(table: np.ndarray, first: int, count: int = 40) -> Columns:
    """Presses of a table one after the other, with two seconds of rest between them."""
    numbers = np.unique(table[:, 0])
    parts, clock = [], 0.0
    for number in numbers[first :: max(len(numbers) // count, 1)][:count]:
        press = table[table[:, 0] == number]
        time = clock + SAMPLE * np.arange(1, len(press) + 1)
        reading = np.where(press[:, 1:2] == PLACES, press[:, 4:5], np.nan)
        load = np.maximum(-press[:, 5], 0.0)
        rest = [[clock, 0.0, *[np.nan] * 3], [time[-1] + SAMPLE, 0.0, *[np.nan] * 3]]
        parts.append(np.vstack([rest[0], np.column_stack([time, load * len(PLACES), reading]), rest[1]]))
        clock = time[-1] + 2.0
    whole = np.vstack(parts)
    return {"time": whole[:, 0], "force": whole[:, 1]} | {f"texel_{i}": whole[:, 2 + i] for i in range(3)}


def hydrogel(data: Path) -> Recording:
    """Voltages of sixteen electrodes over the sum of four load cells (volts, taken as newtons), each recording from zero."""
    from scipy.io import loadmat

    trials: list[tuple[str, str, Columns]] = []
    names = (("sine_K01", "fit"), ("step_force_test_sF01", "fit"), ("sine_K04", "check"), ("step_force_test_sF04", "check"))
    for name, use in names:
        content = loadmat(
            data / "multiaxis_upload" / "data" / f"0_{name}.mat", squeeze_me=True, variable_names=["sensor", "tim2"]
        )
        count = min(len(content["sensor"]), len(content["tim2"]))
        time, volts = content["tim2"][:count], content["sensor"][:count]
        keep = np.append(True, np.diff(time) > 0)
        time, volts = thinned(time[keep], 8), thinned(volts[keep], 8)
        volts = volts - volts[0]
        columns = {"time": time - time[0], "force": np.maximum(volts[:, 16:].sum(axis=1), 0.0)}
        trials.append((name, use, columns | {f"texel_{i}": volts[:, i] for i in range(16)}))
    words = 'grid = { rows = 1, columns = 16, pitch = 0.005 }\nunit = "V"'
    return Recording("hydrogel with electrodes", words, trials, "tared = true")


FURTHER: dict[str, Callable[[Path], Recording]] = {
    "polymer": polymer,
    "polymer-strip": polymer_strip,
    "velostat": velostat,
    "barometer": barometer,
    "barometers": barometers,
    "joint": joint,
    "microfluidic": microfluidic,
    "hydrogel": hydrogel,
}
"""How each set is read from the folder of its repository."""
