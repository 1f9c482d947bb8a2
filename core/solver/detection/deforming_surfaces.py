# SPDX-License-Identifier: GPL-3.0-or-later
"""The deforming targets and sensors of a scenario, frame by frame, for the kernels of :mod:`.detection.deformation`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...effects.engine.sensor_effects import mounted_texels
from ...geometry.bvh import Tree
from ...geometry.contact_points import ContactPoints
from ...geometry.mesh import TriangleMesh, vertex_normals
from ...geometry.texels import Texels
from ...model.deformation import Deformation
from ...model.scenario import Scenario
from ..solver_model import SolverModel
from .deformation import SampleWindow, corners_of, point_speed_bound, stack_windows, vertex_speed_bound, window
from .detection_data import SurfaceMotion


def point_rows(texels: Texels, points: ContactPoints, reference: np.ndarray) -> np.ndarray:
    """Rows of :attr:`.Points.frame`.

    Parameters
    ----------
    texels : Texels
    points : ContactPoints
    reference : (3,) float, metres
        Reference point of the body, in its frame.
    """
    position, normal = points.positions(texels.position) - reference, points.normals(texels.normal)
    return np.hstack([position, normal, texels.tangent[points.texel], texels.bitangent[points.texel]])


class DeformingSurfaces:
    """The shapes of a scenario's targets and sensors, as far as they are known.

    Parameters
    ----------
    scenario : Scenario
    center : (b, 3) float, metres
        Reference point of each body in its frame.
    points : list of ContactPoints
        Of each sensor.
    tree : Tree
    model : SolverModel
        The bounding spheres of sensors that deform are kept up to date in it.
    """

    def __init__(self, scenario: Scenario, center: np.ndarray, points: list[ContactPoints], tree: Tree, model: SolverModel):
        self._targets, self._sensors = scenario.targets, scenario.sensors
        self._vertices = [target.deformation for target in scenario.targets]
        self._texels = [sensor.deformation for sensor in scenario.sensors]
        self._target_center = [center[target.body] for target in scenario.targets]
        self._sensor_center = [center[sensor.body] for sensor in scenario.sensors]
        self._points, self._model = points, model
        meshes = [target.mesh for target in scenario.targets]
        count = len(tree.faces)
        wanted = any(target.smooth or target.deformation is not None for target in scenario.targets)
        corner, self._triangle_start = corners_of(meshes, tree)
        self._corner = corner if wanted else np.zeros((0, 3), np.int64)
        self._triangle_moment = np.full(count if wanted else 0, -1)
        self._clock = np.zeros(3, np.int64)
        self._travel = np.zeros(len(scenario.targets)), np.zeros(len(scenario.sensors))

    @property
    def any_deforms(self) -> bool:
        """Whether anything deforms."""
        return any(found is not None for found in (*self._vertices, *self._texels))

    def extend(self, time: float, vertices: Mapping[int, np.ndarray], texels: Mapping[int, np.ndarray]) -> None:
        """Append the next shapes of some targets and sensors.

        Parameters
        ----------
        time : float, seconds
        vertices : mapping of target index to (nv, 3) float, metres, in the body's frame
        texels : mapping of sensor index to (n, 9) float
            Position (m), normal and tangent of the texels, in the body's frame.
        """
        for known, found in ((self._vertices, vertices), (self._texels, texels)):
            for index, values in found.items():
                before = known[index]
                if before is None:
                    raise ValueError(f"Shape {index} was not declared as deforming.")
                if before.times[-1] < time - 1e-9:
                    known[index] = before.extended(time, values)

    def at(self, moments: np.ndarray) -> SurfaceMotion:
        """Return the shapes between the first and the last of some moments, for the kernels.

        Parameters
        ----------
        moments : (steps + 1,) float, seconds
        """
        vertices = [self._target_window(i, moments) for i in range(len(self._targets))]
        rows = [self._sensor_window(i, moments) for i in range(len(self._sensors))]
        reach = self._model.sensors.max_penetration
        self._fit_spheres(rows)
        return SurfaceMotion(
            any_deforms=np.array([self.any_deforms]),
            target_deforms=np.array([found is not None for found in self._vertices], dtype=np.bool_),
            target_smooth=np.array([target.smooth for target in self._targets], dtype=np.bool_),
            sensor_deforms=np.array([found is not None for found in self._texels], dtype=np.bool_),
            targets=stack_windows(vertices, 6, len(moments)),
            sensors=stack_windows(rows, 12, len(moments)),
            corner=self._corner,
            triangle_start=self._triangle_start,
            target_speed=np.array([vertex_speed_bound(found) for found in vertices]),
            sensor_speed=np.array([point_speed_bound(found, reach[i]) for i, found in enumerate(rows)]),
            target_travel=self._travel[0],
            sensor_travel=self._travel[1],
            triangle_moment=self._triangle_moment,
            clock=self._clock,
        )

    def _target_window(self, index: int, moments: np.ndarray) -> SampleWindow | None:
        """Vertices and, where they are asked for, their normals; None for what neither deforms nor is smooth."""
        target, known = self._targets[index], self._vertices[index]
        if known is None:
            if not target.smooth:
                return None
            known = Deformation(np.zeros(1), target.mesh.vertices[None])
        found = window(known.times, known.values, moments)
        normals = np.zeros_like(found.samples)
        if target.smooth:
            for sample, shape in enumerate(found.samples):
                normals[sample] = vertex_normals(TriangleMesh(shape, target.mesh.triangles))
        return found._replace(samples=np.concatenate([found.samples - self._target_center[index], normals], axis=2))

    def _sensor_window(self, index: int, moments: np.ndarray) -> SampleWindow | None:
        known = self._texels[index]
        if known is None:
            return None
        found = window(known.times, known.values, moments)
        sensor, center = self._sensors[index], self._sensor_center[index]
        bent = [mounted_texels(replace(sensor, texels=sensor.texels.with_local_frames(frames))) for frames in found.samples]
        rows = [point_rows(texels, self._points[index], center) for texels in bent]
        return found._replace(samples=np.stack(rows))

    def _fit_spheres(self, rows: list[SampleWindow | None]) -> None:
        """Fit the spheres around deforming sensors; between two samples the end of a turning segment bulges out."""
        for index, found in enumerate(rows):
            if found is not None:
                reach = self._model.sensors.max_penetration[index]
                turn = np.linalg.norm(np.diff(found.samples[:, :, 3:6], axis=0), axis=2).max(initial=0.0)
                bulge = reach * (1.0 - np.sqrt(max(1.0 - 0.25 * turn**2, 0.0)))
                middle, radius = bounding_sphere(found.samples.reshape(-1, 12), reach)
                self._model.sensors.center[index], self._model.sensors.radius[index] = middle, radius + bulge


def bounding_sphere(points: np.ndarray, reach: float) -> tuple[np.ndarray, float]:
    """Centre and radius of a sphere around contact points (rows of :attr:`.Points.frame`) and the segments behind them."""
    ends = np.vstack([points[:, :3], points[:, :3] - reach * points[:, 3:6]])
    middle = 0.5 * (ends.min(axis=0) + ends.max(axis=0))
    return middle, float(np.linalg.norm(ends - middle, axis=1).max())
