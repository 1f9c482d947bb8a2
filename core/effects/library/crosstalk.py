# SPDX-License-Identifier: GPL-3.0-or-later
"""Texels leak into each other on the way to the reading. Unlike load spreading, what leaks is added and not taken away."""

from __future__ import annotations

import numpy as np

from ...errors import EffectError
from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.coupling_matrix import Weights, coupled, coupling_matrix, nearest_distance
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar


def neighbours(values: Values, transducers: TransducerArray) -> Weights:
    """Add a share of the neighbours: texels up to 1.25 times the median distance of nearest neighbours away."""
    reach, share = 1.25 * nearest_distance(transducers.position), scalar(values, "share")

    def weight(distance: np.ndarray) -> np.ndarray:
        return np.where(distance == 0.0, 1.0, np.where(distance <= reach, share, 0.0))

    return coupling_matrix(transducers.position, weight, reach, None)


def lines(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add a share of the mean of the row and of the mean of the column."""
    share = scalar(values, "share")
    result = signal.copy()
    for line in _rows_and_columns(transducers, "lines"):
        member = (line[:, None] == np.unique(line)).astype(float)
        result += share * (signal @ (member / member.sum(axis=0))) @ member.T
    return result


def common(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add a share of the mean of all texels."""
    return signal + scalar(values, "share") * signal.mean(axis=1, keepdims=True)


def previous(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add a share of the texel before, in the order of the texels; the first has none before it."""
    result = signal.copy()
    result[:, 1:] += scalar(values, "share") * signal[:, :-1]
    return result


def wires(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Couple the wires of the rows with each other, and those of the columns, the less the farther apart they are."""
    share, fall = scalar(values, "share"), scalar(values, "fall")
    row, column = (np.unique(line, return_inverse=True)[1] for line in _rows_and_columns(transducers, "wires"))
    across, along = (_coupled_wires(int(line.max()) + 1, share, fall) for line in (row, column))
    if len(signal) >= len(transducers):  # then all pairs of texels are no more numbers than the signal
        return coupled(signal, across[row[:, None], row] * along[column[:, None], column])
    table = np.zeros((len(signal), len(across), len(along)))
    table[:, row, column] = signal
    return np.asarray((across @ table @ along)[:, row, column])


def _rows_and_columns(transducers: TransducerArray, form: str) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of each texel, (n,) int each."""
    if transducers.row is None or transducers.column is None:
        raise EffectError(
            f"Effect 'crosstalk' ({form}) of sensor '{transducers.name}' needs texels in rows and columns: "
            "choose the form neighbours."
        )
    return transducers.row, transducers.column


def _coupled_wires(count: int, share: float, fall: float) -> np.ndarray:
    """One for a wire itself, and what it takes from each of the others, (count, count) float."""
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    return np.where(apart == 0, 1.0, share * fall ** np.maximum(apart - 1, 0))


KIND = Kind(
    name="crosstalk",
    title="Crosstalk",
    text="The signal of a texel leaks into neighbours, its lines or the texel scanned next.",
    site="readout",
    order=50,
    forms=(
        Form(
            "neighbours",
            "rᵢ = fᵢ + c · Σ fⱼ over the texels next to i",
            "Dahiya and Valle, Robotic Tactile Sensing (2013)",
            (Parameter("share", "1", 0.05, 0.0, 0.25, "Share c that each neighbour adds.", neutral=0.0),),
            coupling=neighbours,
        ),
        Form(
            "lines",
            "rᵢ = fᵢ + c · (mean of the row of i + mean of its column)",
            "D'Alessio, Sens. Actuators A 72 (1999): arrays of resistors scanned by rows and columns",
            (Parameter("share", "1", 0.1, 0.0, 2.0, "Share c of the mean of a line that is added.", neutral=0.0),),
            memoryless=lines,
            couples=True,
            needs="rows",
        ),
        Form(
            "common",
            "rᵢ = fᵢ + c · mean of all f",
            "Saxena, Bhan and Aggrawal, Sens. Actuators A 149 (2009): common parts of the readout of resistive arrays",
            (Parameter("share", "1", 0.2, 0.0, 5.0, "Share c of the mean of all texels that is added.", neutral=0.0),),
            memoryless=common,
            couples=True,
            is_apart=True,
        ),
        Form(
            "previous",
            "rᵢ = fᵢ + c · fᵢ₋₁",
            "Kester (ed.), The Data Conversion Handbook (2005), section 7.3: a multiplexer that has not settled keeps "
            "a part of the channel before",
            (Parameter("share", "1", 0.05, 0.0, 1.0, "Share c that the texel scanned before leaves.", neutral=0.0),),
            memoryless=previous,
            couples=True,
            is_apart=True,
        ),
        Form(
            "wires",
            "r = (1 + A) f (1 + B),  A and B: c · qᵈ⁻¹ between wires d apart, of rows and of columns",
            "Paul, Introduction to Electromagnetic Compatibility (2006), chapter 9: crosstalk between parallel wires",
            (
                Parameter("share", "1", 0.05, 0.0, 0.5, "Share c that the next wire adds.", neutral=0.0),
                Parameter("fall", "1", 0.4, 0.0, 1.0, "Factor q of the share from each wire to the next but one."),
            ),
            memoryless=wires,
            couples=True,
            needs="rows",
            fitted_up_to={"share": 0.25},  # as neighbours: half of a signal in the next wire is how loads spread
            error=0.005,  # of neighbours and lines it leaves 0.0022 at most
        ),
    ),
    experiment="press single texels with a pin, along one row and along one column, at two loads",
    drawing=Drawing(
        "row",
        values={
            "neighbours": {"share": 0.2},
            "lines": {"share": 1.0},
            "common": {"share": 4.0},
            "previous": {"share": 0.3},
            "wires": {"share": 0.2, "fall": 0.5},
        },
    ),
    known_from=("places",),
)
