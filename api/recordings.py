# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings: what sensors measured, as arrays, tables, figures and files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import FileError, PalpateError, imported
from ..core.io import bake_reader, recording_npz
from ..core.model import recording as model
from ..core.model.recording import SENSOR_FIELDS
from . import arguments
from .arguments import ArgumentError
from .running import ShowProgress, finished

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..core.export.exporter import Exporter
    from ..core.figures.figure_style import FigureStyle
    from ..core.model.recording import VectorReadings
    from ..core.skins.magnetic_skin import MagneticSkin

UNITS = {"slip": "m/s", "depth": "m", "contact": "", "net_torque": "N m", "centre_of_pressure": "m"}
"""Units of the arrays that are not in newtons; `reading` has that of the sensor."""
NET = ("net_force", "net_torque", "centre_of_pressure")
"""Arrays of a whole sensor."""


def _channel(name: str, text: str) -> Any:
    def get(self: Recording) -> np.ndarray:
        found: np.ndarray = getattr(self.bake.recording.sensors[self.name], name)
        return found

    return property(get, doc=text)


class Recording:
    """Forces and readings over time: T frames of n texels. Forces act on the sensor and are in the frame of its body.

    With several sensors each is ``recording["its name"]``, which is a recording of its own.
    """

    normal_force: np.ndarray = _channel("normal_force", "(T, n) float, N: along the contact normal.")
    shear: np.ndarray = _channel("shear", "(T, n, 2) float, N: along the x and y axes of each texel.")
    reading: np.ndarray = _channel("reading", "(T, n) float, in `unit`: what the sensor reports.")
    friction: np.ndarray = _channel("friction", "(T, n) float, N: magnitude of the friction force.")
    depth: np.ndarray = _channel("depth", "(T, n) float, m: how deep each texel is pressed.")
    slip: np.ndarray = _channel("slip", "(T, n) float, m/s: relative tangential speed.")
    contact: np.ndarray = _channel("contact", "(T, n) bool.")
    net_force: np.ndarray = _channel("net_force", "(T, 3) float, N.")
    net_torque: np.ndarray = _channel("net_torque", "(T, 3) float, N·m, about the origin of the sensor's body.")
    centre_of_pressure: np.ndarray = _channel("centre_of_pressure", "(T, 3) float, m; zero without contact.")

    def __init__(self, bake: bake_reader.Bake):
        self.bake = bake

    @classmethod
    def of(cls, recording: model.Recording, sensors: recording_npz.Sensors) -> Recording:
        """Return a recording of core with the sensors that made it."""
        bake = bake_reader.Bake(recording, {}, {}, {}, {}, {})
        for name, own in sensors.items():
            bake.texels[name], bake.painted[name], bake.parameters[name] = own
        return cls(bake)

    @property
    def time(self) -> np.ndarray:
        """(T,) float, seconds."""
        return self.bake.recording.times

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(self.bake.recording.sensors)

    @property
    def name(self) -> str:
        """Of the only sensor."""
        if len(self.sensors) != 1:
            first = self.sensors[0]
            raise ArgumentError(
                f"The recording has {len(self.sensors)} sensors ({', '.join(self.sensors)}): name one, as recording[{first!r}]."
            )
        return self.sensors[0]

    @property
    def unit(self) -> str:
        """Of the reading."""
        return self.bake.recording.sensors[self.name].unit

    @property
    def position(self) -> np.ndarray:
        """(n, 3) float, m: where the texels are, in the frame of the sensor's body."""
        return self._described().texels[self.name].position

    @property
    def poses(self) -> dict[str, np.ndarray]:
        """Of each body by name, (T, 7) float: x, y, z (m), qw, qx, qy, qz in the world."""
        recording = self.bake.recording
        return {name: recording.poses[:, i] for i, name in enumerate(recording.body_names)}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the run, one sentence each."""
        return self.bake.recording.warnings

    @property
    def dt(self) -> float:
        """Step of the solver, seconds."""
        return self.bake.recording.dt

    def channels(
        self, skin: MagneticSkin | None = None, shear_stiffness: float | None = None, ambient: ArrayLike | None = None
    ) -> VectorReadings:
        """Return readings of several signed channels: those that the only sensor has recorded, or of another skin on it.

        Parameters
        ----------
        skin : MagneticSkin, optional
            See :func:`palpate.magnetic_skin`. Default: what the sensor's own read-out has recorded.
        shear_stiffness : float, N/m, optional
            Of one texel; texels are displaced along their surface by their shear divided by it. Default: they are not.
        ambient : (T, 3) float, T, optional
            Field of the surroundings in the frame of the sensor's body.

        Returns
        -------
        VectorReadings
            `values` (T, k, 3) in tesla, `clipped` (T, k, 3) bool, and ``said()``, a sentence about what was clipped.

        Raises
        ------
        PalpateError
            The sensor has no such read-out, the skin belongs to another sensor, or a magnet is pressed into a magnetometer.
        """
        from ..core.skins.magnetic_skin import texel_displacements

        if skin is None:
            own = self.bake.recording.sensors[self.name].channels
            if own is None:
                raise ArgumentError(f"Sensor '{self.name}' has one reading per texel: give a skin, as of magnetic_skin().")
            return own
        stiffness = np.inf if shear_stiffness is None else arguments.number(shear_stiffness, "shear_stiffness", True)
        field = None if ambient is None else arguments.numbers(ambient, (len(self), 3), "ambient")
        texels = self._described().texels[self.name]
        return skin.readings(texel_displacements(texels, self.depth, self.shear, stiffness), field)

    def __getitem__(self, name: str) -> Recording:
        arguments.known([name], self.sensors, "sensor")
        return Recording(self.bake.select([name]))

    def __len__(self) -> int:
        return len(self.time)

    def to_xarray(self) -> Any:
        """Return an xarray Dataset of one sensor: every array with its unit, over time and texel.

        Raises
        ------
        PalpateError
            There are several sensors, or xarray is not installed.
        """
        xarray = imported("xarray", "This")
        recorded, shared = self.bake.recording.sensors[self.name], {3: "xyz", 2: "xy"}
        data = {}
        for name in SENSOR_FIELDS:
            values = getattr(recorded, name)
            axes: tuple[str, ...] = ("time",) if name in NET else ("time", "texel")
            axes += tuple(shared[size] for size in values.shape[len(axes) :])
            data[name] = (axes, values, {"units": self.unit if name == "reading" else UNITS.get(name, "N")})
        if recorded.channels is not None:
            data["channels"] = (("time", "place", "channel"), recorded.channels.values, {"units": recorded.channels.unit})
        places = {"time": ("time", self.time, {"units": "s"}), "xyz": list("xyz"), "xy": list("xy")}
        if recorded.channels is not None:
            places["channel"] = list(recorded.channels.names)
        if self.bake.texels:
            places |= {axis: ("texel", self.position[:, i], {"units": "m"}) for i, axis in enumerate(("x", "y", "z"))}
        return xarray.Dataset(data, places, {"sensor": self.name, "dt": self.dt})

    def to_dataframe(self) -> Any:
        """Return a pandas DataFrame with a row for each sensor, frame and texel, and a column for each number of a texel.

        Raises
        ------
        PalpateError
            pandas is not installed.
        """
        pandas = imported("pandas", "This")
        tables = []
        for name, recorded in self.bake.recording.sensors.items():
            frames, texels = recorded.normal_force.shape
            columns = {
                "sensor": np.full(frames * texels, name),
                "time": np.repeat(self.time, texels),
                "texel": np.tile(np.arange(texels), frames),
                "normal_force": recorded.normal_force.ravel(),
                "shear_x": recorded.shear[..., 0].ravel(),
                "shear_y": recorded.shear[..., 1].ravel(),
            }
            columns |= {key: getattr(recorded, key).ravel() for key in ("friction", "depth", "slip", "contact", "reading")}
            tables.append(pandas.DataFrame(columns))
        return pandas.concat(tables, ignore_index=True)

    def plot(self, *kinds: str) -> Figure:
        """Return a figure of all sensors over time, which a notebook shows and ``savefig`` writes.

        Parameters
        ----------
        *kinds : "force", "slip" or "pressure centre"
            Default: the force. Summed normal force is solid and net shear dashed.
        """
        from ..core.figures.time_curves import curves_figure
        from .drawings import shown_in_notebooks

        bake = self._described()
        return shown_in_notebooks(curves_figure(bake.recording, bake.texels, bake.parameters, kinds or ("force",)))

    def show(self, quantity: str = "force", t: float | Sequence[float] | None = None) -> Figure:
        """Return a figure with tactile images, which a notebook shows and ``savefig`` writes.

        Parameters
        ----------
        quantity : str
            That the colours show: "force", "pressure", "reading", "shear", "depth", "slip" or "channels". Arrows are shear.
        t : float or sequence of float, seconds, optional
            The frames nearest to these times. Default: some times over which the forces change.
        """
        from ..core.figures.figure_style import FigureStyle
        from .drawings import shown_in_notebooks

        return shown_in_notebooks(self._images(None if t is None else np.atleast_1d(t), FigureStyle(quantity=quantity)))

    def _images(self, times: Any, style: FigureStyle) -> Figure:
        from ..core.figures.tactile_strip import strip_figure

        bake, frames = self._described(), None
        if times is not None:
            wanted = arguments.numbers(times, (-1,), "t")
            low, high = float(self.time[0]), float(self.time[-1])
            if not len(wanted) or wanted.min() < low - 1e-9 or wanted.max() > high + 1e-9:
                raise ArgumentError(f"t is {times.tolist()}: give times from {low:g} to {high:g} s.")
            frames = [int(bake.recording.frames[np.abs(self.time - time).argmin()]) for time in wanted]
        return strip_figure(bake.recording, bake.texels, frames, style)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the recording with its sensors as .npz, whole or not at all; :func:`read_recording` reads it, and numpy too."""
        if Path(path).suffix != ".npz":
            raise ArgumentError(f"path is '{path}': end the name with .npz.")
        recording_npz.save_recording(path, self.bake.recording, self.bake.sensors)

    def export(
        self,
        kind: str | Exporter,
        folder: str | os.PathLike[str],
        style: FigureStyle | None = None,
        progress: ShowProgress = False,
    ) -> list[Path]:
        """Write the recording in another format into a folder, and return what was written.

        Parameters
        ----------
        kind : str
            "csv", "npz", "hdf5", "png", "mcap", …: the formats of ``palpate export``.
        folder : path
        style : optional
            Colours of pictures.
        progress : bool or callable
        """
        from ..core.export.exporter import export

        return finished(export(self._described(), kind, folder, style), progress, "export", "sensor")

    def _described(self) -> bake_reader.Bake:
        """Return the bake, which has to say where the texels are."""
        if not self.bake.texels:
            raise FileError("This recording does not say where its texels are: read the whole bake with read_bake.")
        return self.bake

    def __repr__(self) -> str:
        recording = self.bake.recording
        peaks = [f"'{name}' {one.normal_force.shape[1]} texels" for name, one in recording.sensors.items()]
        force = max((float(one.normal_force.sum(axis=1).max(initial=0.0)) for one in recording.sensors.values()), default=0.0)
        said = f", {len(self.warnings)} warnings" if self.warnings else ""
        return f"<Recording: {len(self)} frames to {self.time[-1]:.3g} s, {', '.join(peaks)}, at most {force:.4g} N{said}>"

    def _repr_html_(self) -> str:
        """The tactile images over time, for notebooks."""
        from ..core.figures.figure_style import FigureStyle
        from .drawings import png_tag

        try:
            picture = png_tag(self._images(None, FigureStyle(width="middle")))
        except PalpateError:
            picture = ""
        return f"<div>{escape(repr(self))}</div>{picture}"


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Read a recording that :meth:`Recording.save` wrote, or the recording.npz of a bake, which has no texels.

    Raises
    ------
    PalpateError
        There is no such file, or it is damaged or something else.
    """
    return Recording.of(*recording_npz.load_with_sensors(path))


def read_bake(folder: str | os.PathLike[str]) -> Recording:
    """Read a bake of Blender or ``palpate bake``: a bake folder, or the folder of one sensor in it.

    Raises
    ------
    PalpateError
        There is no bake, or a file of it is damaged.
    """
    return Recording(bake_reader.read_bake(folder))
