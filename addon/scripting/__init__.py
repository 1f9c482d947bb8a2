# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects of the scene for scripts: ``palpate.sensor_of`` and ``palpate.scenario_of``."""

__all__ = ["scene_objects"]
