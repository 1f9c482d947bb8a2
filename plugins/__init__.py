# SPDX-License-Identifier: GPL-3.0-or-later
"""Palpate's sensors as sensors of the engines that people train in; each module needs its engine, and imports it when used."""

__all__ = ["engine_sensors", "newton"]
