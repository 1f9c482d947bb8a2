# SPDX-License-Identifier: GPL-3.0-or-later
"""Published recordings of real sensors and materials, converted into rigs; benchmarks/RESULTS.md says what they are."""

from __future__ import annotations

import json
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

Columns = dict[str, np.ndarray]

PLACES = 9
"""Where the tube is pressed, in turn."""


@dataclass(frozen=True)
class Recording:
    """A set of recordings: name of the rig, lines of its [sensor], trials as (name, use, columns), lines of each [[trial]]."""

    name: str
    sensor: str
    trials: list[tuple[str, str, Columns]]
    words: str = ""

    def write(self, folder: Path) -> Path:
        """Write it as a rig and return the path of its TOML file."""
        folder.mkdir(parents=True, exist_ok=True)
        lines = ['format = "palpate-rig/1"', f'name = "{self.name}"', "[sensor]", self.sensor]
        for trial, use, columns in self.trials:
            lines += ["[[trial]]", f'file = "{trial}.csv"', f'use = "{use}"', self.words]
            table = np.column_stack(list(columns.values()))
            rows = [",".join("" if np.isnan(value) else f"{value:.9g}" for value in row) for row in table.tolist()]
            (folder / f"{trial}.csv").write_text("\n".join([",".join(columns), *rows]) + "\n", encoding="utf-8")
        path = folder / "rig.toml"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path


def of_spring(name: str, k: float, trials: list[tuple[str, str, Columns]]) -> Recording:
    """Return recordings over depth of one channel of a stiffness, without damping."""
    return Recording(
        name, f"grid = {{ rows = 1, columns = 1, pitch = 0.01 }}\nk = {k:.4g}\ncn = 0.0\nmax_penetration = 0.1", trials
    )


def thinned(values: np.ndarray, by: int) -> np.ndarray:
    """Means of `by` samples each, along the first axis."""
    whole = len(values) // by * by
    return values[:whole].reshape(-1, by, *values.shape[1:]).mean(axis=1)


def insole(data: Path) -> Recording:
    """280 texels under air pressure (bar → newtons on a texel of 1 cm²); two recordings fitted, three held out.

    Each texel rests at counts of its own, and some jump between 0 and 255. The median of the first second of each recording is
    subtracted, and texels are left out whose counts do not follow the pressure in the recordings to be fitted (correlation
    above -0.85).
    """
    from scipy.io import loadmat

    names = (("calibration_dataset", "fit"), ("validation_dataset_1", "fit"))
    names += (("validation_dataset_2", "check"), ("validation_dataset_3", "check"))
    names += (("experiment_Inf_15September_dynamic_1", "check"),)
    found: list[tuple[str, str, np.ndarray, np.ndarray, np.ndarray]] = []
    for name, use in names:
        content = loadmat(data / "insole_iit_280taxel" / f"{name}.mat", squeeze_me=True, struct_as_record=False)
        recording = next(value for key, value in content.items() if not key.startswith("__"))
        count = min(len(recording.C), len(recording.P))  # the pressure has no clock of its own
        counts, bar = np.asarray(recording.C, float)[:count], np.asarray(recording.P, float)[:count]
        counts[:, 2:] -= np.median(counts[:50, 2:], axis=0)
        by = max(1, count // 900)
        time = thinned(counts[:, 1], by)
        found.append((name, use, time - time[0], thinned(bar, by), thinned(counts[:, 2:], by)))
    bars, counts = (np.concatenate([entry[i] for entry in found if entry[1] == "fit"]) for i in (3, 4))
    bars, counts = bars - bars.mean(), counts - counts.mean(axis=0)
    follows = bars @ counts / (np.linalg.norm(bars) * np.maximum(np.linalg.norm(counts, axis=0), 1e-12))
    keep = follows < -0.85
    trials: list[tuple[str, str, Columns]] = []
    for name, use, time, bar, counts in found:
        columns = {"time": time, "force": bar * 1e5 * 1e-4 * keep.sum()}
        trials.append((name, use, columns | {f"texel_{i}": c for i, c in enumerate(counts[:, keep].T)}))
    # Where the texels lie is not said; they are put in one line, and what neighbours do cannot be asked.
    grid = f"grid = {{ rows = 1, columns = {keep.sum()}, pitch = 0.01 }}"
    return Recording("insole under air pressure", f'{grid}\nunit = "counts"', trials)


def tube(data: Path) -> Recording:
    """Mean of both pressures of a soft tube over the load cell's volts, taken as newtons."""
    trials: list[tuple[str, str, Columns]] = []
    for name, use in (("nowater", "fit"), ("10mm", "fit"), ("50mm", "check"), ("30mm", "check")):
        milliseconds, volts, left, right = timetable(data / "fsi_tube_tactile" / f"1D_underwater_{name}.mat")
        load = -(volts - np.median(volts[:50]))
        pressure = 0.5 * (left + right)
        columns = {"time": thinned(milliseconds * 1e-3, 4), "force": np.maximum(thinned(load, 4), 0.0)}
        trials.append((name, use, columns | {"texel_0": thinned(pressure - np.median(pressure[:50]), 4)}))
    return Recording("soft tube", 'grid = { rows = 1, columns = 1, pitch = 0.02 }\nunit = "V"', trials)


def tube_by_place(data: Path) -> Recording:
    """The same with a channel for each of the nine places that are pressed one after the other: the others are empty then."""
    plain = tube(data)
    trials: list[tuple[str, str, Columns]] = []
    for name, use, columns in plain.trials:
        pressed = columns["force"] > 0.3 * columns["force"].max()
        edges = np.flatnonzero(np.diff(pressed.astype(int)))
        begins, ends = edges[::2] + 1, edges[1::2] + 1
        if len(begins) != PLACES or len(ends) != PLACES:
            raise ValueError(f"{name} has {len(begins)} presses and not {PLACES}")
        # A channel takes over shortly before its press: by then the answer to the one before has died away.
        place = np.searchsorted(begins[1:] - (begins[1:] - ends[:-1]) // 4, np.arange(len(pressed)), side="right")
        reading = {f"texel_{i}": np.where(place == i, columns["texel_0"], np.nan) for i in range(PLACES)}
        trials.append((name, use, {"time": columns["time"], "force": PLACES * columns["force"], **reading}))
    grid = f"grid = {{ rows = 1, columns = {PLACES}, pitch = 0.02 }}"
    return Recording("soft tube, a channel for each place", f'{grid}\nunit = "V"', trials)


def adhesive(data: Path) -> Recording:
    """Shear stress (kPa, taken as newtons) of an adhesive over strain, a strain of one taken as a depth of 1 mm."""
    trials: list[tuple[str, str, Columns]] = []
    for name, use in (("1", "fit"), ("5", "fit"), ("2", "check")):
        table = sheet(data / "oca_vhb_viscoelastic_mit" / f"shear_relaxation_{name}.xlsx")
        time, first = np.unique(table[:, 0], return_index=True)
        strain, stress = table[first, 4], table[first, 1]
        even = np.linspace(time[0], time[-1], min(1200, 4 * len(time)))
        columns = {"time": even - even[0], "depth": np.maximum(np.interp(even, time, strain), 0.0) * 1e-3}
        trials.append((f"relaxation_{name}", use, columns | {"texel_0": np.interp(even, time, stress)}))
    stiff = max(float(c["texel_0"].max() / c["depth"].max()) for _, _, c in trials)
    return of_spring("adhesive in shear", stiff, trials)


def foam(data: Path) -> Recording:
    """Compression of 10 mm of foam under 1 cm² at 1 % a second; held out is another foam, scaled to the same start."""
    curves = {}
    for name in ("leap", "turbo"):
        table = np.loadtxt(data / "foam_leap_turbo_avg_mit" / f"{name}_foam_UC.csv", delimiter=",", skiprows=1)
        order = np.argsort(-table[:, 0])
        curves[name] = (1.0 - table[order, 0]) * 0.01, -table[order, 1] * 1e6 * 1e-4

    def stiffness(depth, force):
        """Steepest part of the first fifth: before it the plates settle, and that toe is not the foam's (ASTM D1621, A1)."""
        low = (depth > 0) & (depth < 0.2 * depth.max())
        return float(np.gradient(force[low], depth[low]).max())

    trials, wanted = [], stiffness(*curves["leap"])
    for (name, (depth, force)), use in zip(curves.items(), ("fit", "check"), strict=True):
        time = depth / 1e-4
        even = np.linspace(time[0], time[-1], 400)
        scaled = force * wanted / stiffness(depth, force)
        columns = {"time": even, "depth": np.interp(even, time, depth), "texel_0": np.interp(even, time, scaled)}
        trials.append((name, use, columns))
    return of_spring("shoe foam", wanted, trials)


def brake(data: Path) -> Recording:
    """Friction force of a band brake over its travel; the normal force is not known and taken as constant."""
    trials: list[tuple[str, str, Columns]] = []
    for name, use in (("dataset-1_0.5Hz35lbtension", "fit"), ("dataset-1_1Hz35lbtension", "check")):
        table = np.array(json.loads((data / "brfd_friction_backlash" / f"{name}.json").read_text())["data"], float)
        table = thinned(table[:, :3], 8)
        columns = {"time": table[:, 0], "depth": np.full(len(table), 1e-3), "slide_x": table[:, 1] * 0.0254}
        trials.append((name.replace(".", "_"), use, columns | {"force_x": table[:, 2] * 4448.22}))
    words = "k = 3e7\nsigma0 = 5e6\nsigma1 = 1e4\nmax_penetration = 0.1"  # of its friction nothing is known
    return Recording("band brake", f"grid = {{ rows = 1, columns = 1, pitch = 0.05 }}\n{words}", trials)


def timetable(path: Path) -> list[np.ndarray]:
    """Return the columns of a MATLAB timetable, its times (ms) first.

    What MATLAB saves of an object SciPy returns as bytes; the columns are the arrays of doubles in them, equally long.
    """
    from scipy.io import loadmat

    saved = loadmat(path)["__function_workspace__"].tobytes()
    double, least = 9, 8 * 1000
    tags = ((at, *struct.unpack_from("<II", saved, at)) for at in range(8, len(saved) - 8, 8))
    found = [(at + 8, size) for at, kind, size in tags if kind == double and size >= least and at + 8 + size <= len(saved)]
    return [np.frombuffer(saved, "<f8", size // 8, at) for at, size in found]


def sheet(path: Path) -> np.ndarray:
    """Return the numbers of the first sheet of an Excel file, NaN where there is none."""
    space = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
    with zipfile.ZipFile(path) as file:
        root = ElementTree.fromstring(file.read("xl/worksheets/sheet1.xml"))
    rows: list[dict[int, float]] = []
    for row in root.iter(f"{space}row"):
        cells = {}
        for cell in row.iter(f"{space}c"):
            value = cell.find(f"{space}v")
            if value is not None and value.text and cell.get("t", "n") == "n":
                cells[_column(cell.get("r", "A1"))] = float(value.text)
        rows.append(cells)
    width = 1 + max(max(cells, default=0) for cells in rows)
    table = np.array([[cells.get(i, np.nan) for i in range(width)] for cells in rows])
    return table[np.isfinite(table).any(axis=1)]


def _column(name: str) -> int:
    number = 0
    for letter in name.rstrip("0123456789"):
        number = 26 * number + ord(letter) - ord("A") + 1
    return number - 1
