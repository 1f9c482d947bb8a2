# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks of stimulus and response that are shifted or run apart, and samples that one of them lost.

The changes of load and response are correlated in windows of each recording, at shifts of up to some seconds. Of three simple
courses of the shift over time, constant, line and step, the one with the largest sum of correlations is taken. Changes and not
values are compared, because creep, drift and hysteresis hardly move a change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..dataset.rig import Rig
from ..dataset.shift_peak import peak_offset
from ..dataset.trial import Trial
from ..forward.stimulus import Stimulus
from .clock_corrections import moved, net_force_along_normal, refined_shifts, strongest_channels, with_shift
from .data_fault import Correction, DataFault

LONGEST_SHIFT, LARGEST_SHIFT_SHARE = 3.0, 0.25
"""Longest shift that is looked for: seconds, and share of a recording."""
MOST_SAMPLES, MOST_CHANNELS = 3000, 12
"""Samples and channels per recording that are compared."""
LEAST_SAMPLES = 64
WINDOWS = 24
SMOOTHING = 0.1
"""Seconds over which changes are taken."""
LEAST_SHIFT, LEAST_SHIFT_SAMPLES = 0.1, 3.0
"""Smallest shift that is a fault: seconds, and samples. Lag, creep and loops of a sensor move its changes less."""
LONGEST_LAG = 0.3
"""Seconds by which a response may be late in all recordings: a sensor may be that slow (the effect `lag`)."""
LAG_STAGES = (1, 2, 3)
LAG_TIMES = np.geomspace(0.4, 2.5, 13)
"""Numbers of equal low passes in turn, and their whole delays in units of the shift, with which a sensor that lags is compared.
A lag smears the response, a shifted clock does not."""
LEAST_GAIN = 0.1
"""Least increase of the correlation of the changes by a shift, a line or a step."""
MOST_LEFT = 0.6
"""What lacks to a correlation of one must become less by this factor: in a recording that repeats itself, another period fits
about as well."""
LEAST_SIDE = 0.15
"""Least share of the correlation, and of the load's way, on either side of a step."""
LEAST_RETURN = 0.4
"""Least way back of the load on either side of a step, as a share of its way there, or the reverse. Where no place has it,
there is no line either. A sensor that answers late while it is loaded and early while it is unloaded has a dead zone or gets
stiffer. One that relaxes or goes slack answers most where a load that moves at one speed cannot show a shift. A lost sample
moves loading and unloading alike."""
LONG_STEP = 0.6
"""Seconds from which on a step must make the response quieter where nothing touches."""
QUIETER, UNLOADED = 0.5, 0.02
"""Without load the squared changes must become less by this factor; and the share of the largest load below which that is."""
RATES = np.linspace(-0.08, 0.08, 161)
"""Rates at which two clocks may run apart."""
SAME_RATE = 0.25
"""Largest difference of the rates of two recordings with the same clocks, as a share of the rate."""
LEAST_CORRELATION = 0.4
"""Least correlation of the changes, with the shift, from which a clock can be judged."""
LEAST_DRIFT = 0.12
"""Smallest difference of the shift, between the ends of a recording or at a step, in seconds."""


@dataclass(frozen=True)
class Course:
    """How late a response is over a recording: ``start + rate · (t − t₀)`` seconds, and `step` more from `since` on."""

    start: float
    rate: float
    step: float
    since: float
    correlation: float
    unshifted: float
    line: Course | None = None
    """The best line, where the course is a constant."""

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return how late the response is at some times of the recording, (T,) s."""
        late: np.ndarray = self.start + self.rate * (time - time[0]) + self.step * (time >= self.since)
        return late


def find_clock_faults(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Return shifted clocks, clocks that run apart and dropped samples of some recordings."""
    courses = {s.trial.name: course for s in stimuli if (course := course_of(s)) is not None}
    steps = {name: c for name, c in courses.items() if c.step}
    rates = {name: c for name, c in courses.items() if c.rate}
    if rates:  # two clocks that run apart do so in all recordings, also where the evidence is weaker
        usual = float(np.median([c.rate for c in rates.values()]))
        for name, c in courses.items():
            if c.line is not None and c.line.correlation > c.correlation and abs(c.line.rate - usual) < SAME_RATE * abs(usual):
                rates[name] = c.line
        courses |= rates
    typical = float(np.median([c.start for c in courses.values()])) if courses else 0.0
    shifts = {}
    for s in stimuli:
        course = courses.get(s.trial.name)
        if course is None or course.step or course.rate:
            continue
        least = max(LEAST_SHIFT, LEAST_SHIFT_SAMPLES * s.trial.step)
        gains = _is_clearly_better(course.correlation, course.unshifted)
        is_common = abs(course.start - typical) < least
        if is_common and course.start > LONGEST_LAG and _is_clearly_better(_correlation_of_lag(s, course), course.correlation):
            continue
        if gains and (course.start < -least or course.start > (max(LONGEST_LAG, least) if is_common else least)):
            shifts[s.trial.name] = course
    if shifts and "clock-shift" in rig.correct:
        exact = refined_shifts(rig, [s.trial for s in stimuli if s.trial.name in shifts], [c.start for c in shifts.values()])
        shifts = {name: replace(shifts[name], start=start) for name, start in zip(shifts, exact, strict=True)}
    faults = []
    for kind, found, say in (
        ("clock-shift", shifts, _say_shift),
        ("clock-rate", rates, _say_rate),
        ("dropped-samples", steps, _say_step),
    ):
        if found:
            name = max(found, key=lambda one: found[one].correlation - found[one].unshifted)
            corrections = {one: _on_time(course) for one, course in found.items()}
            faults.append(DataFault(kind, tuple(found), say(found[name], name), corrections))
    return faults


def course_of(stimulus: Stimulus) -> Course | None:
    """Return how late the response of a recording is over time; None if that cannot be judged."""
    prepared = _changes(stimulus)
    if prepared is None:
        return None
    time, load, response, step = prepared
    most = int(min(LONGEST_SHIFT, LARGEST_SHIFT_SHARE * (time[-1] - time[0])) / step)
    if most < 4:
        return None
    table = _windowed(load, response, most)
    size = np.sqrt(float((load * load).sum())) * np.sqrt(float((response * response).sum()))
    if size <= 0.0:
        return None
    table /= size
    if -table.sum(axis=0).min() > table.sum(axis=0).max():  # a response that falls under load is as good as one that rises
        table = -table
    shifts = np.arange(-most, most + 1) * step
    middles = (np.arange(WINDOWS) + 0.5) / WINDOWS * (time[-1] - time[0])
    total = table.sum(axis=0)
    best = int(np.argmax(total))
    unshifted = float(total[most])
    peak = float(shifts[best] + peak_offset(total, best) * (shifts[1] - shifts[0]))
    constant = Course(peak, 0.0, 0.0, np.inf, float(total[best]), unshifted)
    possible = _returns_on_both_sides(load)
    if not possible.any():  # one press: its two flanks are no evidence of a course
        return constant if constant.correlation >= LEAST_CORRELATION else None
    line = _best_line(table, shifts, middles, unshifted)
    jump = _best_step(table, shifts, middles + time[0], unshifted, possible)
    chosen = replace(constant, line=line)
    least = max(LEAST_DRIFT, 4.0 * step)
    if _is_clearly_better(max(line.correlation, jump.correlation), constant.correlation):
        other = jump if jump.correlation > line.correlation else line
        span = abs(other.step) if other.step else abs(other.rate) * (time[-1] - time[0])
        may_be_period = abs(other.step) > LONG_STEP  # of a recording that repeats itself
        if span >= least and not (may_be_period and not _stays_quiet_without_load(stimulus, prepared, other)):
            chosen = other
    return chosen if chosen.correlation >= LEAST_CORRELATION else None


def _is_clearly_better(new: float, old: float) -> bool:
    """True if one correlation is so much larger than another one that this is no accident."""
    return new - old >= LEAST_GAIN and 1.0 - new < MOST_LEFT * (1.0 - old)


def _correlation_of_lag(stimulus: Stimulus, course: Course) -> float:
    """Largest correlation of the changes of response and load behind low passes that delay the load about as much."""
    from scipy.signal import lfilter

    prepared = _changes(stimulus)
    if prepared is None:
        return 0.0
    _, load, response, step = prepared
    size, best = float((response * response).sum()), 0.0
    for stages in LAG_STAGES:
        for tau in LAG_TIMES * course.start / stages:
            keeps = float(np.exp(-step / tau))
            late = load
            for _ in range(stages):
                late = lfilter([1.0 - keeps], [1.0, -keeps], late, axis=0)
            product = abs(float((late * response).sum()))
            best = max(best, product / max(np.sqrt(float((late * late).sum()) * size), 1e-300))
    return best


def _stays_quiet_without_load(
    stimulus: Stimulus, prepared: tuple[np.ndarray, np.ndarray, np.ndarray, float], course: Course
) -> bool:
    """True if responses without load change far less if they are moved by a course; True if nothing is ever unloaded.

    A sensor that answers to a part of its loads only, as one that softens does, may fit as well at another period of a
    recording that repeats itself. But then it would answer where nothing touches.
    """
    time, _, response, step = prepared
    load = _signals(stimulus)[0].max(axis=1)
    width = max(1, round(SMOOTHING / step))
    even = np.interp(time - 0.5 * width * step, stimulus.trial.time, load)
    near = max(1, round(LONGEST_LAG / step))
    touched = np.convolve(even > UNLOADED * even.max(), np.ones(2 * near + 1), "same") > 0.5
    squares = (response * response).sum(axis=1)
    moved = np.arange(len(time)) + np.round(course.at(time) / step).astype(int)
    inside = (moved >= 0) & (moved < len(time)) & ~touched
    if inside.sum() < LEAST_SAMPLES:
        return True
    return float(squares[moved[inside]].mean()) < QUIETER * float(squares[~touched].mean())


def _changes(stimulus: Stimulus) -> tuple[np.ndarray, np.ndarray, np.ndarray, float] | None:
    """Even times, changes of load and of response on them (T, c), and the step; None without enough of either."""
    trial = stimulus.trial
    load, response = _signals(stimulus)
    good = np.isfinite(response).all(axis=1)
    if good.sum() < LEAST_SAMPLES or not load.any():
        return None
    step = max(trial.step, float(np.ptp(trial.time)) / MOST_SAMPLES)
    if np.ptp(trial.time) / step > 2 * MOST_SAMPLES:
        return None
    even = np.arange(trial.time[0], trial.time[-1], step)
    on_even = [
        np.stack([np.interp(even, trial.time[good], column[good]) for column in values.T], axis=1)
        for values in (load, response)
    ]
    width = max(1, round(SMOOTHING / step))
    if len(even) < width + LEAST_SAMPLES:
        return None
    x, y = (values[width:] - values[:-width] for values in on_even)
    return even[width:], x / max(float(np.abs(x).max()), 1e-300), y / max(float(np.abs(y).max()), 1e-300), step


def _signals(stimulus: Stimulus) -> tuple[np.ndarray, np.ndarray]:
    """Loads and responses (T, c) of the channels with the largest loads; the net force counts only without readings."""
    if stimulus.trial.reading is None:
        return stimulus.load.sum(axis=1, keepdims=True), net_force_along_normal(stimulus)
    chosen = strongest_channels(stimulus, MOST_CHANNELS)
    return stimulus.load[:, chosen], stimulus.trial.reading[:, chosen]


def _window_edges(count: int) -> np.ndarray:
    """Where each window begins, (windows,)."""
    return np.linspace(0, count, WINDOWS + 1).astype(int)[:-1]


def _windowed(load: np.ndarray, response: np.ndarray, most: int) -> np.ndarray:
    """Sums of products of load and shifted response, (windows, 2 most + 1); windows of the load."""
    count = len(load)
    edges = _window_edges(count)
    padded = np.concatenate([np.zeros((most, load.shape[1])), response, np.zeros((most, load.shape[1]))])
    table = np.empty((WINDOWS, 2 * most + 1))
    for k in range(2 * most + 1):
        table[:, k] = np.add.reduceat((load * padded[k : k + count]).sum(axis=1), edges)
    return table


def _best_line(table: np.ndarray, shifts: np.ndarray, middles: np.ndarray, unshifted: float) -> Course:
    """The line of the shift over time with the largest sum of correlations."""
    step, most = float(shifts[1] - shifts[0]), len(shifts) // 2
    starts, rows = np.arange(len(shifts))[:, None], np.arange(len(table))[None]
    padded = np.concatenate([table, np.zeros((len(table), 1))], axis=1)  # outside of the table there is no correlation
    best = (-np.inf, 0, 0.0)
    for rate in RATES:
        index = starts + np.round(rate * middles / step).astype(int)
        index = np.where((index >= 0) & (index < len(shifts)), index, len(shifts))
        value = padded[rows, index].sum(axis=1)
        at = int(np.argmax(value))
        best = max(best, (float(value[at]), at - most, float(rate)))
    return Course(best[1] * step, best[2], 0.0, np.inf, best[0], unshifted)


def _returns_on_both_sides(load: np.ndarray) -> np.ndarray:
    """True if the load both rises and falls before and after the end of each window but the last, (windows - 1,) bool."""
    edges = _window_edges(len(load))
    ways = [np.add.reduceat(np.maximum(sign * load, 0.0).sum(axis=1), edges) for sign in (1.0, -1.0)]

    def returns(backwards: bool) -> np.ndarray:
        way = slice(None, None, -1) if backwards else slice(None)
        there, back = (np.cumsum(values[way])[way] for values in ways)
        found: np.ndarray = np.minimum(there, back) >= LEAST_RETURN * np.maximum(there, back)
        return found & (there + back >= LEAST_SIDE * float(ways[0].sum() + ways[1].sum()))

    return returns(False)[:-1] & returns(True)[1:]


def _best_step(table: np.ndarray, shifts: np.ndarray, middles: np.ndarray, unshifted: float, possible: np.ndarray) -> Course:
    """The step of the shift, from one constant to another, with the largest sum of correlations, where one is possible."""
    before, after = np.cumsum(table, axis=0), np.cumsum(table[::-1], axis=0)[::-1]
    left, right = before.max(axis=1)[:-1], after.max(axis=1)[1:]
    value = np.where(possible & (np.minimum(left, right) > LEAST_SIDE * (left + right)), left + right, -np.inf)
    at = int(np.argmax(value))
    first, second = float(shifts[before[at].argmax()]), float(shifts[after[at + 1].argmax()])
    since = 0.5 * (middles[at] + middles[at + 1])
    return Course(first, 0.0, second - first, since, float(value[at]), unshifted)


def _on_time(course: Course) -> Correction:
    """A function that moves the responses of a trial to the time of the stimulus; what was not recorded then is missing."""

    def act(trial: Trial) -> Trial:
        if course.rate or course.step:
            return moved(trial, trial.time + course.at(trial.time))
        return with_shift(trial, course.start)

    return act


def _say_shift(course: Course, name: str) -> str:
    way = "after" if course.start > 0 else "before"
    return (
        f"in '{name}.csv' the response comes {abs(course.start):.3g} s {way} the stimulus "
        f"(correlation of their changes {course.correlation:.2f}, unshifted {course.unshifted:.2f})"
    )


def _say_rate(course: Course, name: str) -> str:
    return (
        f"in '{name}.csv' the response's clock loses {course.rate:.2%} against that of the stimulus "
        f"(correlation of their changes {course.correlation:.2f}, {course.unshifted:.2f} with one clock)"
    )


def _say_step(course: Course, name: str) -> str:
    return (
        f"in '{name}.csv' the response jumps by {abs(course.step):.3g} s against the stimulus at about {course.since:.3g} s "
        f"(correlation of their changes {course.correlation:.2f}, {course.unshifted:.2f} without the jump)"
    )
