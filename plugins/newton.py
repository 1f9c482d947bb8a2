# SPDX-License-Identifier: GPL-3.0-or-later
"""A Palpate sensor in a model of Newton, in the manner of ``newton.sensors.SensorContact``."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.errors import ParameterError
from ..core.geometry.mesh import TriangleMesh
from ..core.geometry.shapes import Shape
from ..core.simulators.contact_translation import NewtonContact
from ..core.simulators.environment_parameters import Columns
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from ..core.simulators.warp.engine import require_engine
from .engine_sensors import EngineSensors, target_of

Labels = str | Sequence[str] | re.Pattern[str] | Sequence[int]
"""Shapes of a model: a glob pattern, several of them, a compiled regular expression, or indices."""


class SensorTouch:
    """A tactile sensor on shapes of a Newton model.

    Each shape that `sensing_shapes` names carries the sensor: its frame is that of the texels. Its counterparts are the
    shapes of the same world, or of all worlds, that `counterpart_shapes` names. Between these, Newton's own contact has to be
    off where :meth:`update` adds the wrench to the bodies, as by ``has_shape_collision=False`` in their configuration.

    Parameters
    ----------
    model : newton.Model
    sensor : Sensor
        As ``palpate.read_sensor`` returns it.
    dt : float, seconds
        Between two updates: a substep of the solver.
    sensing_shapes, counterpart_shapes : str, list of str, re.Pattern or list of int
        By label or index.
    apply : bool
        Let :meth:`update` add the wrench on the object in contact, and its opposite on the sensor, to ``state.body_f``.
    single : bool
        Compute in float32. Newton's poses are float32 in any case.
    parameters : mapping of str to (rows,) float, optional
        In which the sensors of rows differ, as ``{"k": …, "mus": …}``.

    Raises
    ------
    PalpateError
        Newton is missing or too old, a label names no shape, or shapes differ from world to world or are of another kind than
        plane, sphere, capsule, box and mesh.

    Attributes
    ----------
    sensing_indices : list of int
        Shape of each row of the results.
    counterpart_indices : list of list of int
        Shapes that press, for each row.
    texels, readings, contact, wrench, too_deep, valid : warp.array
        See :class:`.WarpSensors`, whose environments are the rows.
    """

    def __init__(
        self,
        model: Any,
        sensor: SensorOnMesh,
        dt: float,
        *,
        sensing_shapes: Labels,
        counterpart_shapes: Labels,
        apply: bool = True,
        single: bool = False,
        parameters: Columns | None = None,
    ):
        newton = require_engine("newton", "newton", (1, 8))
        self._model, self._apply = model, apply
        self.sensing_indices = _matches(model, sensing_shapes, "sensing_shapes")
        pressing = _matches(model, counterpart_shapes, "counterpart_shapes")
        worlds = model.shape_world.numpy()
        self.counterpart_indices = [
            [one for one in pressing if worlds[one] in (worlds[row], -1) or worlds[row] == -1] for row in self.sensing_indices
        ]
        targets = [_shapes(newton, model, row) for row in self.counterpart_indices]
        for row, found in zip(self.sensing_indices, targets, strict=True):
            if not found or not _are_same(found, targets[0]):
                raise ParameterError(
                    f"The counterparts of shape '{model.shape_label[row]}' differ from those in the first world: "
                    "let counterpart_shapes name as many shapes, of equal sizes, in every world."
                )
        options = dt, len(targets), model.device, single, parameters
        self._touch = EngineSensors("SensorTouch", sensor, targets[0], *options)
        sensors = self._sensors = self._touch.sensors
        self.texels, self.readings, self.contact = sensors.texels, sensors.readings, sensors.contact
        self.wrench, self.too_deep, self.valid = sensors.wrench, sensors.too_deep, sensors.valid
        rows = zip(self.sensing_indices, self.counterpart_indices, strict=True)
        self._indices = self._touch.indices([[row, *others] for row, others in rows])

    def __repr__(self) -> str:
        return f"<SensorTouch: {len(self.sensing_indices)} × {self._sensors!r}>"

    def update(self, state: Any) -> None:
        """Go on by one step, to the poses of a state, and add the wrenches to ``state.body_f``.

        Call it after ``state.clear_forces()`` and before the solver's step. It asks nothing of the host.

        Parameters
        ----------
        state : newton.State
        """
        from . import engine_kernels as kernels

        model, poses, (rows, columns) = self._model, self._sensors.poses, self._indices.shape
        places = self._indices, model.shape_body
        self._touch.launch(kernels.write_newton_poses, (rows, columns), *places, model.shape_transform, state.body_q, poses)
        self._sensors.step()
        if self._apply:
            inputs = model.body_com, state.body_q, poses, self.wrench, state.body_f
            self._touch.launch(kernels.add_newton_wrenches, (rows, columns - 1), *places, *inputs)

    def reset(self, mask: Any = None) -> None:
        """Let rows begin again with their next update (see :meth:`.WarpSensors.reset`)."""
        self._sensors.reset(mask)


def pressure_law(model: Any, contact: NewtonContact, sensing_shapes: Labels) -> tuple[Any, Any]:
    """Return ``pressure_func`` and ``pressure_data`` for ``newton.geometry.HydroelasticSDF.Config``.

    Newton's own contact then carries the object with the pressure of a sensor. Other shapes keep their `kh`, and should be much
    stiffer.

    Parameters
    ----------
    model : newton.Model
    contact : NewtonContact
        As ``palpate.newton_contact`` returns it.
    sensing_shapes : str, list of str, re.Pattern or list of int
        Shapes with this pressure, by label or index.

    Raises
    ------
    PalpateError
        Newton is missing or too old, or a label names no shape.
    """
    require_engine("newton", "newton", (1, 8))
    import warp

    from .newton_pressure import PressureData, sensor_pressure

    is_sensor = np.zeros(len(model.shape_label), np.int32)
    is_sensor[_matches(model, sensing_shapes, "sensing_shapes")] = 1
    data = PressureData()
    data.pressure, data.step = warp.array(contact.pressure, dtype=float, device=model.device), contact.step
    data.is_sensor = warp.array(is_sensor, dtype=int, device=model.device)
    data.stiffness = model.shape_material_kh
    return sensor_pressure, data


def _matches(model: Any, wanted: Labels, name: str) -> list[int]:
    """Return the shapes with these labels, in ascending order."""
    labels = list(model.shape_label)
    if isinstance(wanted, re.Pattern):
        found = [i for i, label in enumerate(labels) if wanted.fullmatch(label)]
    elif isinstance(wanted, str):
        found = [i for i, label in enumerate(labels) if fnmatch.fnmatch(label, wanted)]
    else:
        found = [i for i, label in enumerate(labels) for one in wanted if i == one or _is_named(label, one)]
    if not found:
        few = ", ".join(labels[:6])
        raise ParameterError(f"{name} {wanted!r} is no shape of the model: take labels or indices of these: {few}.")
    return sorted(set(found))


def _is_named(label: str, pattern: str | int) -> bool:
    return isinstance(pattern, str) and fnmatch.fnmatch(label, pattern)


def _shapes(newton: Any, model: Any, indices: list[int]) -> list[TriangleMesh | Shape]:
    """Return shapes of the model as targets."""
    kinds, scales = model.shape_type.numpy(), model.shape_scale.numpy().astype(float)
    found: list[TriangleMesh | Shape] = []
    for index in indices:
        kind, scale = newton.GeoType(int(kinds[index])).name.lower(), scales[index]
        kind = "finite plane" if kind == "plane" and scale[:2].any() else kind
        mesh = model.shape_source[index]
        found.append(
            target_of(
                f"Shape '{model.shape_label[index]}'", kind, scale, lambda mesh=mesh, scale=scale: (
                    np.array(mesh.vertices, float) * scale, mesh.indices
                ),
            )
        )  # fmt: skip
    return found


def _are_same(these: list[TriangleMesh | Shape], others: list[TriangleMesh | Shape]) -> bool:
    if len(these) != len(others):
        return False
    pairs = zip(these, others, strict=True)
    return all(type(a) is type(b) and (_same_mesh(a, b) if isinstance(a, TriangleMesh) else a == b) for a, b in pairs)


def _same_mesh(a: Any, b: Any) -> bool:
    return np.array_equal(a.vertices, b.vertices) and np.array_equal(a.triangles, b.triangles)
