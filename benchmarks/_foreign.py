# SPDX-License-Identifier: GPL-3.0-or-later
"""Openly licensed recordings of other people's sensors, and a model of each by hand of at most five numbers per channel.

The models were written down here, and committed, before they were fitted; only the cubic of eFlesh's normal force had been
tried before. A model is a list of terms whose weights follow from a linear fit for each channel, in a few numbers that all
channels share (:mod:`._handmade`).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from palpate.core.gap.dataset.column_names import GRAVITY
from palpate.core.gap.dataset.second_logger import interpolated

from ._handmade import HandmadeModel, low_pass
from ._recordings import Columns, Recording, adhesive, brake, foam, insole, of_spring, sheet, thinned, tube, tube_by_place

RUNS = (("20250401_014340_probe", "fit"), ("20250401_015037_probe", "check"))
"""Of eFlesh's normal force: whole runs."""
SHEAR = "20250416_200533_probe"
LARGEST = ("1d5", "2d0", "2d5", "3d0")
"""Largest stretches of the tape."""
TAPE_SAMPLES = 200
"""Even samples of each recording of the tape, and of the foam in shear."""
THINNED = 2
"""Samples of eFlesh of which means are taken."""
OSCILLATOR_PARTS = (("first", "fit", slice(40700, 44796)), ("second", "check", slice(49400, 53496)))
"""Of the oscillator: samples of two random multisines, each from its beginning."""
OSCILLATOR_RATE = 1e7 / 2**14
"""Hz."""
PRELOAD = 0.2
"""Volts added to the oscillator's drive, as a known force presses and does not pull."""
DAMPER_STEP = 2e-3
"""Seconds between samples of the damper: what its displacements and speeds agree on."""
TONGS_THINNED = {"train": 20, "test": 3}
"""Of how many samples of the tongs one is taken; they are in random order."""


def _eflesh(folder: Path) -> Columns:
    """Force (N) at the times of the magnetometers, and their channels."""
    states = np.loadtxt(folder / "states.csv", delimiter=",")
    sensor = np.loadtxt(folder / "sensor_post_baselines.csv", delimiter=",")
    force = np.where(states[:, 4] < 0.0, np.nan, states[:, 4]) * 1e-3 * GRAVITY
    inside = (sensor[:, 0] >= states[0, 0]) & (sensor[:, 0] <= states[-1, 0])
    at = interpolated(states[:, 0], force, sensor[inside, 0])
    table = np.column_stack([sensor[inside, 0], at, sensor[inside, 1:]])
    table = thinned(table[np.isfinite(table).all(axis=1)], THINNED)
    channels = {f"texel_{i}": column for i, column in enumerate(table[:, 2:].T)}
    return {"time": table[:, 0] - table[0, 0], "force": table[:, 1], **channels}


def _as_recording(name: str, trials: list[tuple[str, str, Columns]]) -> Recording:
    count = sum(column.startswith("texel_") for column in trials[0][2])
    # a known force is shared by all texels: each of n channels sees the n-th part, so the number of channels is taken out
    shared = [(trial, use, columns | {"force": count * columns["force"]}) for trial, use, columns in trials]
    return Recording(name, f'grid = {{ rows = 1, columns = {count}, pitch = 0.01 }}\nunit = "uT"', shared)


def eflesh_normal(data: Path) -> Recording:
    """15 channels of five magnetometers under a lattice with magnets; one run of presses is fitted, another one checked."""
    folder = data / "eflesh_magnetic_mit" / "normal_force"
    return _as_recording("eFlesh, normal force", [(name, use, _eflesh(folder / name)) for name, use in RUNS])


def eflesh_shear(data: Path) -> Recording:
    """30 channels of ten magnetometers; there is one run, of which the first half is fitted."""
    columns = _eflesh(data / "eflesh_magnetic_mit" / "shear_force" / SHEAR)
    half = len(columns["time"]) // 2
    parts = (("first", "fit", slice(0, half)), ("second", "check", slice(half, None)))
    trials = [(name, use, {key: values[part] for key, values in columns.items()}) for name, use, part in parts]
    return _as_recording("eFlesh, shear", trials)


def tape(data: Path) -> Recording:
    """VHB 4910 that is stretched and released: nominal stress (kPa, taken as newtons) over stretch, a stretch of two as 1 mm.

    Rates of 0.01 and 0.05 a second are fitted, up to four largest stretches each; the rate between them is checked.
    """
    trials: list[tuple[str, str, Columns]] = []
    for rate, stretches, use in (("01", LARGEST, "fit"), ("05", LARGEST, "fit"), ("03", LARGEST[:3], "check")):
        for largest in stretches:
            time, stretch, stress = sheet(data / "oca_vhb_viscoelastic_mit" / f"loading_{largest}_unloading_0d{rate}.xlsx").T
            time, first = np.unique(time, return_index=True)
            even = np.linspace(time[0], time[-1], TAPE_SAMPLES)
            depth = np.maximum(np.interp(even, time, stretch[first]) - 1.0, 0.0) * 1e-3
            columns = {"time": even - even[0], "depth": depth, "texel_0": np.interp(even, time, stress[first])}
            trials.append((f"stretch_{largest}_rate_{rate}", use, columns))
    stiff = max(float(c["texel_0"].max() / c["depth"].max()) for _, _, c in trials)
    return of_spring("acrylic tape in tension", stiff, trials)


def foam_shear(data: Path) -> Recording:
    """Simple shear of 10 mm of foam under 1 cm² at 1 % a second; held out is another foam, scaled to the same slope at rest."""
    curves = {}
    for name in ("leap", "turbo"):
        strain, stress = np.loadtxt(data / "foam_leap_turbo_avg_mit" / f"{name}_foam_SS.csv", delimiter=",", skiprows=1).T
        kept = strain >= 0.0
        curves[name] = strain[kept] * 0.01, stress[kept] * 1e6 * 1e-4
    slopes = {name: float(np.polyfit(depth[:10], force[:10], 1)[0]) for name, (depth, force) in curves.items()}
    trials: list[tuple[str, str, Columns]] = []
    for (name, (depth, force)), use in zip(curves.items(), ("fit", "check"), strict=True):
        even = np.linspace(0.0, depth[-1], TAPE_SAMPLES)
        scaled = np.interp(even, depth, force) * slopes["leap"] / slopes[name]
        trials.append((name, use, {"time": even / 1e-4, "depth": even, "texel_0": scaled}))
    return of_spring("shoe foam in shear", slopes["leap"], trials)


def oscillator(data: Path) -> Recording:
    """Silverbox: an electronic mass on a spring that stiffens. Drive (V, taken as newtons) and response (V).

    ``examples/statespace/silverbox/SilverboxFiles`` of pytorch-ident in ``silverbox``.
    """
    drive, response = np.genfromtxt(data / "silverbox" / "SNLS80mV.csv", delimiter=",", skip_header=1)[:, :2].T
    trials: list[tuple[str, str, Columns]] = []
    for name, use, part in OSCILLATOR_PARTS:
        time = np.arange(part.stop - part.start) / OSCILLATOR_RATE
        trials.append((name, use, {"time": time, "force": drive[part] + PRELOAD, "texel_0": response[part]}))
    return Recording("Silverbox", 'grid = { rows = 1, columns = 1, pitch = 0.01 }\nunit = "V"', trials)


def damper(data: Path) -> Recording:
    """Bouc–Wen damper: its force over its travel (cm); the voltage, which sets its yield, is the normal force.

    ``datasets/bouc_wen`` of sysidentpy-data in ``bouc_wen``.
    """
    table = np.loadtxt(data / "bouc_wen" / "boucwen_histeretic_system.csv", delimiter=",", skiprows=1)
    half = len(table) // 2
    trials: list[tuple[str, str, Columns]] = []
    for name, use, part in (("first", "fit", table[:half]), ("second", "check", table[half:])):
        columns = {"time": np.arange(half) * DAMPER_STEP, "force": 1e3 * part[:, 3], "slide_x": 1e-2 * part[:, 0]}
        trials.append((name, use, columns | {"force_x": part[:, 4]}))
    return Recording("Bouc–Wen damper", "grid = { rows = 1, columns = 1, pitch = 0.05 }", trials)


def tongs(data: Path) -> Recording:
    """Places (mm) of a marker and four corners behind a soft finger, over the largest of the six loads that bend it.

    ``SupplementaryFile-A-ThreeDataset/baseline`` of SoftRoboticTongs in ``tongs``.
    """
    trials: list[tuple[str, str, Columns]] = []
    for name, use in (("train", "fit"), ("test", "check")):
        loads, places = (
            np.loadtxt(data / "tongs" / f"baseline_{kind}_{name}.csv", delimiter=",")[:: TONGS_THINNED[name]]
            for kind in ("FT", "pose")
        )
        pressed = loads[:, 1] < 0.0
        channels = {f"texel_{i}": column for i, column in enumerate(places[pressed].T)}
        trials.append((name, use, {"time": np.arange(pressed.sum()) * 1.0, "force": 15.0 * -loads[pressed, 1], **channels}))
    return Recording("soft robotic tongs", 'grid = { rows = 1, columns = 15, pitch = 0.01 }\nunit = "mm"', trials)


def _cubic(p, c):
    """A cubic of the force, and what is there without one."""
    force = c["force"] / 5e2
    return [np.ones_like(force), force, force**2, force**3]


def _insole(p, c):
    """A gain that falls with the pressure, and what is there without one."""
    force = c["force"] / 2.5e3
    return [np.ones_like(force), force, force**2]


def _tube(p, c):
    """The force behind one low pass, and what is there without one."""
    return [np.ones_like(c["force"]), low_pass(c["time"], c["force"], p[0])]


def _adhesive(p, c):
    """A spring and two Maxwell branches."""
    strain = c["depth"] * 1e3
    return [strain, *(strain - low_pass(c["time"], strain, tau) for tau in p)]


def _foam(p, c):
    """A spring, and a densification that goes with a power of the strain."""
    strain = c["depth"] * 1e2
    return [strain, strain ** p[0]]


def _tape(p, c):
    """A neo-Hookean strip and two Maxwell branches."""
    stretch = 1.0 + c["depth"] * 1e3
    stress = stretch - stretch**-2.0
    return [stress, *(stress - low_pass(c["time"], stress, tau) for tau in p)]


def _foam_shear(p, c):
    """A spring, and a cubic part."""
    strain = c["depth"] * 1e2
    return [strain, strain**3]


def _bristles(travel, length):
    """Return the deflection of Dahl's bristles along a travel."""
    bristle = np.zeros_like(travel)
    for t in range(1, len(travel)):
        step = travel[t] - travel[t - 1]
        bristle[t] = (bristle[t - 1] + step) / (1.0 + abs(step) / length)
    return bristle


def _brake(p, c):
    """Dahl's bristles, and viscous friction."""
    travel = c["slide_x"]
    return [np.ones_like(travel), _bristles(travel, 1e-3 * p[0]), np.gradient(travel, c["time"])]


def _oscillator(p, c):
    """Duffing's oscillator: a mass on a spring and a damper, with a force that goes with the cube of its place."""
    steps = 4
    dt = float(np.diff(c["time"]).mean()) / steps
    drive = np.interp(np.arange(len(c["time"]) * steps) * dt, c["time"] - c["time"][0], c["force"] - PRELOAD)
    turn = 2.0 * np.pi * p[0]
    a, b = expm_of_oscillator(turn, p[1], dt)
    (a11, a12), (a21, a22), (b1, b2), cube = *a.tolist(), b.tolist(), float(p[2])
    x = v = 0.0
    place = []
    for u in drive.tolist():
        place.append(x)
        pull = u - cube * x**3
        x, v = a11 * x + a12 * v + b1 * pull, a21 * x + a22 * v + b2 * pull
    return [np.ones_like(c["force"]), np.array(place[::steps])]


def expm_of_oscillator(turn: float, damping: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how place and speed of an oscillator of stiffness 1 follow from themselves, and from a force, over a step."""
    from scipy.linalg import expm

    system = np.zeros((3, 3))
    system[:2] = [[0.0, 1.0, 0.0], [-(turn**2), -2.0 * damping * turn, turn**2]]
    step = expm(system * dt)
    return step[:2, :2], step[:2, 2]


def _damper(p, c):
    """Dahl's bristles and viscous friction, each with a part that goes with the voltage."""
    travel = c["slide_x"]
    bristle = _bristles(travel, 1e-3 * p[0])
    volts, rate = c["force"] * 1e-3, np.gradient(travel, c["time"])
    return [bristle, volts * bristle, rate, volts * rate]


FOREIGN: dict[str, tuple[Callable[[Path], Recording], HandmadeModel]] = {
    "eflesh-normal": (eflesh_normal, HandmadeModel(_cubic)),
    "eflesh-shear": (eflesh_shear, HandmadeModel(_cubic)),
    "insole": (insole, HandmadeModel(_insole)),
    "tube": (tube, HandmadeModel(_tube, (0.5,), (0.02,), (5.0,))),
    "tube-by-place": (tube_by_place, HandmadeModel(_tube, (0.5,), (0.02,), (5.0,))),
    "adhesive": (adhesive, HandmadeModel(_adhesive, (5.0, 100.0), (0.1, 5.0), (50.0, 5000.0))),
    "foam": (foam, HandmadeModel(_foam, (6.0,), (1.5,), (30.0,))),
    "tape": (tape, HandmadeModel(_tape, (5.0, 100.0), (0.1, 5.0), (50.0, 5000.0))),
    "foam-shear": (foam_shear, HandmadeModel(_foam_shear)),
    "brake": (brake, HandmadeModel(_brake, (1.0,), (0.01,), (20.0,))),
    "oscillator": (oscillator, HandmadeModel(_oscillator, (70.0, 0.05, 1.0), (40.0, 0.005, -50.0), (120.0, 0.5, 50.0))),
    "damper": (damper, HandmadeModel(_damper, (1.0,), (0.01,), (20.0,))),
    "tongs": (tongs, HandmadeModel(_cubic)),
}
"""How each set is read from the folder of all data, and its model by hand; docs/real-data.md says what the sets are and how
they are split. None is left out because it goes badly."""
