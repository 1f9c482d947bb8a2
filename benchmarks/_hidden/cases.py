# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases: a pad, an indenter, six trials, something hidden or nothing; written as a rig, with the answer kept apart.

Each case follows from its kind and number alone. How strong a hidden effect is, is told by what it does to the recording: its
root mean square is between 4 and 12 % of the full range, six to twenty times the noise, so that it is worth finding and does
not drown all else.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .other import MAKERS, OUTSIDE
from .own import OWN
from .third import THIRD
from .world import (
    COLUMNS,
    DEEP,
    PITCH,
    RATE,
    ROWS,
    SECONDS,
    THICKNESS,
    Contact,
    Hidden,
    N,
    Pad,
    Probe,
    Signals,
    converted,
    net_force,
    respond,
    touch,
)

TRIALS = (("fit", 4), ("check", 2))
SHARE = (0.04, 0.12)
"""Of the full range: what a hidden effect does to the recording, root mean square."""
IN_FORCE = ("stribeck", "viscous-friction")
"""Effects that show in the net force along the surface and not in the readings."""
KINDS = ("other", "own", "none", "two", "outside", "poor", "third", "three", "simulated")
"""The last one is for methods that learn from simulations: none to three effects in the library's own forms."""
FAMILIES = {"other": MAKERS, "own": OWN, "third": THIRD, "outside": OUTSIDE}
"""Kinds of cases in which one effect is hidden, and its makers; a case's number runs through them."""
SEVERAL = {"two": 2, "three": 3}
"""Kinds of cases in which several effects are hidden, in formulas of :mod:`.other`, and how many."""
SIMULATED = (0.1, 0.45, 0.3, 0.15)
"""Shares of simulated cases with none to three effects."""
ORDER = list(MAKERS)
"""The way from the contact to the reading, in which several effects act."""
BALL_ONLY = ("misalignment", "load-spreading", "crosstalk")
"""A flat indenter loads all texels alike: where the pad sits, and what neighbours do, cannot show under it."""
VAGUE = ("creep", "hysteresis", "lag", "softening")
"""What a single slow press does not tell apart."""
POOR = {
    "one slow press": VAGUE,
    "never unloaded": ("stiffening", "dead-zone", "hysteresis", "creep"),
    "one level": ("creep", "drift", "stiffening", "saturation"),
    "one place": ("gain-mismatch", "misalignment", "crosstalk", "dead-texels"),
    "too noisy": ("creep", "stiffening", "lag", "saturation"),
}
"""Ways in which a recording is too poor, and what is hidden in it; a case's number runs through the ways, then the effects."""


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes
    ----------
    kind : str
    number : int
    hidden : tuple of Hidden
    pad : Pad
    probe : Probe
    times, paths : lists of arrays
    readings, forces : lists of arrays, with noise
    clean : list of pairs of arrays
        Readings and forces without noise.
    share : tuple of float
        What each effect does to the recording, root mean square over what was touched, of the full range.
    noise : float
        Standard deviation in the sensor's unit.
    words : dict
        What the rig says of the sensor; not always true.
    """

    kind: str
    number: int
    hidden: tuple[Hidden, ...]
    pad: Pad
    probe: Probe
    times: list[np.ndarray]
    paths: list[np.ndarray]
    readings: list[np.ndarray]
    clean: list[tuple[np.ndarray, np.ndarray]]
    share: tuple[float, ...]
    forces: list[np.ndarray]
    noise: float
    words: dict

    @property
    def answer(self) -> list[str]:
        """Names of what is hidden."""
        return [effect.name for effect in self.hidden]


def draw(kind: str, number: int) -> Case:
    """Return case `number` of a kind; the same every time."""
    rng, pad, probe, names = _begun(kind, number)
    makers = {"own": OWN, "simulated": OWN, "third": THIRD}.get(kind, {**MAKERS, **OUTSIDE})
    way = list(POOR)[number % len(POOR)] if kind == "poor" else ""
    time, programmes = np.arange(round(SECONDS * RATE) + 1) / RATE, _programmes(rng, way)
    times, paths = [time] * len(programmes), [_path(time, knots, probe) for knots in programmes]
    plain = [touch(probe, pad, time, path) for time, path in zip(times, paths, strict=True)]
    found = [_calibrated(makers[name], name, rng, pad, probe, plain) for name in names]
    hidden = tuple(effect for effect, _ in found)
    contacts = _moved(hidden, pad, probe, plain)
    pressed = [respond(contact, pad, hidden, slides=False) for contact in contacts]
    signals = [
        replace(one, shear=_shear(one.contact, knots, probe, pad, hidden))
        for one, knots in zip(pressed, programmes, strict=True)
    ]
    full = max(float(np.abs(s.reading - pad.zero).max()) for s in signals)
    noise = rng.uniform(0.003, 0.01) * full * (30.0 if way == "too noisy" else 1.0)
    coloured = kind in ("none", "simulated") and number % 3 == 2
    readings = [converted(s.reading + noise * _noise(rng, s.reading.shape, coloured), pad, hidden) for s in signals]
    largest = max(float(np.abs(net_force(s)).max()) for s in signals)
    forces = [net_force(s) + 0.003 * largest * _noise(rng, (len(s.time), 3), coloured) for s in signals]
    clean = [(converted(s.reading, pad, hidden), net_force(s)) for s in signals]
    shares = tuple(share for _, share in found)
    words = _words(rng, pad, kind, number)
    return Case(kind, number, hidden, pad, probe, times, paths, readings, clean, shares, forces, noise, words)


def answer_of(kind: str, number: int) -> list[str]:
    """Return the names of what is hidden in a case, without drawing it."""
    return _begun(kind, number)[-1]


def _begun(kind: str, number: int) -> tuple[np.random.Generator, Pad, Probe, list[str]]:
    """What a case is drawn from, in this order: random numbers, pad, probe, names of what is hidden."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), number])
    pad = _pad(rng)
    ball = bool(rng.integers(2)) if kind != "poor" else True
    probe = Probe(rng.uniform(9e-3, 16e-3), None) if ball else Probe(None, (0.04, 0.07, 0.02))
    return rng, pad, probe, _names(kind, number, rng, ball)


def _moved(hidden: tuple[Hidden, ...], pad: Pad, probe: Probe, plain: list[Contact]) -> list[Contact]:
    """The contacts again, where something moves the texels."""
    if all(effect.place is None for effect in hidden):
        return plain
    return [touch(probe, pad, contact.time, contact.path, hidden) for contact in plain]


def _pad(rng) -> Pad:
    k = float(np.exp(rng.uniform(np.log(30), np.log(120))))
    mus = rng.uniform(0.4, 0.7)
    unit, gain, zero = [
        ("N", 1.0, 0.0),
        ("counts", rng.uniform(500, 2000), rng.uniform(20, 80)),
        ("V", rng.uniform(1, 4), 0.2),
    ][rng.integers(3)]
    return Pad(
        k, 0.01 * k, mus, rng.uniform(0.6, 0.95) * mus, rng.uniform(0.005, 0.03), 0.5 * k, 0.005 * k, 0.01, gain, zero, unit
    )


def _names(kind: str, number: int, rng, ball: bool) -> list[str]:
    if kind == "none":
        return []
    if kind == "poor":
        choice = POOR[list(POOR)[number % len(POOR)]]
        return [choice[number // len(POOR) % len(choice)]]
    blind = () if ball else BALL_ONLY
    if kind in FAMILIES:
        pool = list(FAMILIES[kind])
        name = pool[number % len(pool)]
        return [name if name not in blind else pool[(number + 7) % len(pool)]]
    if kind == "simulated":
        known = [name for name in OWN if name not in blind]
        count = rng.choice(len(SIMULATED), p=SIMULATED)
    else:
        unclear = ("noise", "quantization", "offset", "dead-texels")
        known, count = [name for name in ORDER if name not in unclear and name not in blind], SEVERAL[kind]
    return sorted(map(str, rng.choice(known, size=count, replace=False)), key=ORDER.index)


def _words(rng, pad: Pad, kind: str, number: int) -> dict:
    """What the rig says: rounded nominal values, now and then wrong ones."""
    wrong = kind in ("none", "simulated") and number % 3 == 1
    k = pad.k * (rng.uniform(0.6, 1.6) if wrong else rng.uniform(0.95, 1.05))
    words = {
        "thickness": THICKNESS,
        "k": float(f"{k:.3g}"),
        "cn": float(f"{0.01 * k:.3g}"),
        "sigma0": float(f"{pad.sigma0:.4g}"),
        "sigma1": float(f"{pad.sigma1:.4g}"),
        "ct": pad.ct,
        "mus": round(pad.mus, 2),
        "mud": round(pad.mud, 2),
        "x0": round(pad.x0, 3),
        "unit": pad.unit,
    }
    if pad.unit == "N" or not wrong:
        words |= {"gain": float(f"{pad.gain:.4g}"), "zero": float(f"{pad.zero:.4g}")}
    return words


def _noise(rng, shape, coloured: bool) -> np.ndarray:
    white = rng.normal(size=shape)
    if not coloured:
        return white
    keep, out = 0.9, np.empty(shape)
    out[0] = white[0]
    for t in range(1, len(out)):
        out[t] = keep * out[t - 1] + np.sqrt(1 - keep**2) * white[t]
    return out


# --- what the probe does


Knots = list[tuple[float, float, float, float]]
"""Times (s), x, y and depths (m) between which a probe moves on straight lines, the last of them until the end."""
ACCELERATION_TIME = 0.1
"""Seconds over which the speed changes from line to line: a stage that is told to move at 0.1 m/s accelerates at 1 m/s²."""
LONGEST_STEP = 2.5e-4
"""Metres between two times at which friction is integrated; half as long, net forces change by 2 to 40 % of their noise."""


def _programmes(rng, way: str) -> list[Knots]:
    """Six programmes of 25 s: staircase, cycles, press and hold, slides, and two of all to check on; of some ways to be poor
    six times the same.
    """
    makers = [PROGRAMMES[way]] * 6 if way in PROGRAMMES else [_staircase, _cycles, _holds, _slides, _mixture, _mixture]
    return [maker(rng) for maker in makers]


def _path(time: np.ndarray, knots: Knots, probe: Probe) -> np.ndarray:
    """(T, 3) metres: the probe's middle along straight lines, whose corners are rounded in time."""
    at, *columns = np.array(knots).T
    moments = time + np.linspace(-0.5, 0.5, 33)[:, None] * ACCELERATION_TIME
    x, y, depth = (np.interp(moments, at, column).mean(axis=0) for column in columns)
    return np.stack([x, y, probe.lowest - depth], axis=1)


def _shear(contact: Contact, knots: Knots, probe: Probe, pad: Pad, hidden: tuple[Hidden, ...]) -> np.ndarray:
    """Friction at the samples, (T, n, 3) N, integrated with several steps from sample to sample where the probe is fast."""
    moved = np.linalg.norm(np.diff(contact.path, axis=0), axis=1)
    steps = max(int(np.ceil(moved.max() / LONGEST_STEP)), 1)
    time = np.arange((len(contact.time) - 1) * steps + 1) / (RATE * steps)
    fine = touch(probe, pad, time, _path(time, knots, probe), hidden)
    return respond(fine, pad, tuple(replace(effect, reading=None) for effect in hidden)).shear[::steps]


def _spots(rng, count: int) -> np.ndarray:
    """(count, 2) metres: places on the pad, spread along it."""
    y = np.linspace(-0.32, 0.32, count) * ROWS * PITCH
    return np.stack([rng.uniform(-0.25, 0.25, count) * COLUMNS * PITCH, rng.permutation(y)], axis=1)


UP = -1e-3
"""Depth while nothing touches, metres."""


def _staircase(rng):
    (x, y), steps = _spots(rng, 1)[0], rng.permutation([0.25, 0.5, 0.75, 1.0])
    knots, t = [(0, x, y, UP), (1.0, x, y, UP)], 1.0
    for share in (*np.sort(steps), *np.sort(steps)[-2::-1]):
        knots += [(t + 0.6, x, y, DEEP * share), (t + 2.4, x, y, DEEP * share)]
        t += 2.4
    return [*knots, (t + 0.8, x, y, UP), (SECONDS, x, y, UP)]


def _cycles(rng):
    knots, t = [(0, 0, 0, UP), (1.0, 0, 0, UP)], 1.0
    for (x, y), period in zip(_spots(rng, 4), (0.8, 1.6, 3.0, 1.2), strict=True):
        knots += [(t + 0.3, x, y, UP)]
        t += 0.3
        for depth in rng.uniform(0.5, 1.0, 3) * DEEP:
            knots += [(t + period / 2, x, y, depth), (t + period, x, y, UP)]
            t += period
    return [*knots, (SECONDS, x, y, UP)]


def _holds(rng):
    knots, t = [(0, 0, 0, UP), (1.0, 0, 0, UP)], 1.0
    for (x, y), hold in zip(_spots(rng, 3), (3.0, 8.0, 4.0), strict=True):
        depth, quick = DEEP * rng.uniform(0.6, 1.0), rng.uniform(0.15, 0.4)
        knots += [(t + 0.3, x, y, UP), (t + 0.3 + quick, x, y, depth), (t + 0.3 + quick + hold, x, y, depth)]
        knots += [(t + 0.6 + quick + hold, x, y, UP), (t + 2.0 + quick + hold, x, y, UP)]
        t += 2.0 + quick + hold
    return [*knots, (SECONDS, x, y, UP)]


def _slides(rng):
    knots, t = [(0, 0, 0, UP), (1.0, 0, 0, UP)], 1.0
    for depth in rng.permutation([0.6, 0.9]) * DEEP:
        y = 0.25 * ROWS * PITCH * rng.choice([-1, 1])
        knots += [(t + 0.3, 0, y, UP), (t + 0.9, 0, y, depth), (t + 1.3, 0, y, depth)]
        t += 1.3
        for speed in rng.permutation([0.004, 0.012, 0.04, 0.1]):
            y = -y
            travel = min(2 * abs(y) / speed, 3.5)
            goal = np.clip(-y + np.sign(y) * speed * travel, -abs(y), abs(y))
            knots += [(t + travel, 0, goal, depth), (t + travel + 0.4, 0, goal, depth)]
            t, y = t + travel + 0.4, goal
        knots += [(t + 0.5, 0, y, UP)]
        t += 0.8
    return [*knots, (max(SECONDS, t), 0, y, UP)]


def _mixture(rng):
    """Some of everything at other places, depths and speeds."""
    knots, t = [(0, 0, 0, UP), (1.0, 0, 0, UP)], 1.0
    for x, y in _spots(rng, 3):
        depth, quick = DEEP * rng.uniform(0.4, 1.0), np.exp(rng.uniform(np.log(0.15), np.log(1.0)))
        knots += [(t + 0.3, x, y, UP), (t + 0.3 + quick, x, y, depth), (t + 2.3 + quick, x, y, depth)]
        t += 2.3 + quick
        low, speed = 0.4 * depth, rng.uniform(0.005, 0.05)
        far = y + 0.006 * rng.choice([-1, 1])
        slide = 0.006 / speed
        knots += [
            (t + 0.5, x, y, low),
            (t + 1.0, x, y, depth),
            (t + 1.0 + slide, x, far, depth),
            (t + 1.4 + slide, x, far, depth),
        ]
        knots += [(t + 1.9 + slide, x, far, UP), (t + 2.9 + slide, x, far, UP)]
        t += 2.9 + slide
    return [*knots, (max(SECONDS, t), x, far, UP)]


def _one_slow_press(rng):
    """The same in every trial: no rate, no hold, no other texels."""
    return [(0, 0, 0, UP), (1, 0, 0, UP), (13, 0, 0, 3e-3), (SECONDS, 0, 0, UP)]


def _never_unloaded(rng):
    """One ramp that ends where it is deepest."""
    return [(0, 0, 0, UP), (1, 0, 0, UP), (SECONDS, 0, 0, 3e-3)]


def _one_level(rng):
    """Pressed before the recording begins, and until it ends."""
    depth = rng.uniform(2e-3, 3e-3)
    return [(0, 0, 0, depth), (SECONDS, 0, 0, depth)]


def _one_place(rng):
    """Cycles of one depth, in the middle of the pad: most texels are never touched."""
    knots, t = [(0, 0, 0, UP), (1, 0, 0, UP)], 1.0
    while t < SECONDS - 3:
        knots += [(t + 1, 0, 0, 2e-3), (t + 2, 0, 0, 2e-3), (t + 3, 0, 0, UP)]
        t += 3.0
    return [*knots, (SECONDS, 0, 0, UP)]


PROGRAMMES = {
    "one slow press": _one_slow_press,
    "never unloaded": _never_unloaded,
    "one level": _one_level,
    "one place": _one_place,
}


def _calibrated(maker, name: str, rng, pad: Pad, probe: Probe, contacts: list[Contact]) -> tuple[Hidden, float]:
    """Return the effect at a strength at which it changes the recording by the wanted share of the range, and the share."""
    seed = int(rng.integers(2**32))
    wanted = rng.uniform(*SHARE)
    slides = name in IN_FORCE
    plain = [respond(contact, pad, slides=slides) for contact in contacts]
    full = max(float(np.abs(_seen(None, name, s, pad)).max()) for s in plain)

    def change(strength: float) -> float:
        effect = maker(np.random.default_rng(seed), strength)
        total = 0.0
        for before, contact in zip(plain, _moved((effect,), pad, probe, contacts), strict=True):
            after = respond(contact, pad, (effect,), slides)
            a, b = _seen(effect, name, after, pad), _seen(None, name, before, pad)
            loaded = (after.depth > 0) | (before.depth > 0)
            touched = loaded if a.shape == loaded.shape else loaded.any(axis=1)[:, None] & np.ones_like(a, bool)
            total += float(((a - b)[touched] ** 2).mean())
        return np.sqrt(total / len(plain)) / full

    low, high, strength, share = 0.02, 3.0, 0.5, 0.0
    for _ in range(8):  # regula falsi of a growing function, kept inside what is known
        share = change(strength)
        if abs(share / wanted - 1) < 0.05 or high < 1.001 * low:
            break
        low, high = (strength, high) if share < wanted else (low, strength)
        guess = strength * wanted / max(share, 1e-9)
        strength = guess if low < guess < high else np.sqrt(low * high)
    return maker(np.random.default_rng(seed), float(strength)), float(share)


def _seen(effect: Hidden | None, name: str, signals: Signals, pad: Pad) -> np.ndarray:
    """What an effect shows in, (T, channels)."""
    if name in IN_FORCE:
        return net_force(signals)[:, :2]
    return converted(signals.reading, pad, () if effect is None else (effect,)) - pad.zero


# --- files


GRID = f"grid = {{ rows = {ROWS}, columns = {COLUMNS}, pitch = [{PITCH!r}, {PITCH!r}] }}"
"""What a rig says of where the texels are."""


def write(case: Case, folder: Path, name: str = "") -> Path:
    """Write a case as a rig and return the path of its TOML file; only the number, in the name, says anything of the answer."""
    folder.mkdir(parents=True, exist_ok=True)
    if case.probe.radius is not None:
        shape = f"{{ sphere = {case.probe.radius!r} }}"
    else:
        shape = f"{{ box = [{', '.join(map(repr, case.probe.size))}] }}"
    words = "\n".join(
        f"{key} = {value!r}" if not isinstance(value, str) else f'{key} = "{value}"' for key, value in case.words.items()
    )
    uses = [use for use, count in TRIALS for _ in range(count)]
    lines = [
        'format = "palpate-rig/1"', f'name = "{name or f"case {case.number}"}"', "[sensor]",
        GRID, words, "[indenter]", f"shape = {shape}",
    ]  # fmt: skip
    header = ["time", "x", "y", "z", *(f"texel_{i}" for i in range(N)), "force_x", "force_y", "force_z"]
    for i, use in enumerate(uses):
        lines += ["[[trial]]", f'file = "trial_{i}.csv"', f'use = "{use}"']
        table = np.hstack([case.times[i][:, None], case.paths[i], case.readings[i], case.forces[i]])
        rows = ["%.7g," * (table.shape[1] - 1) % tuple(row[:-1]) + f"{row[-1]:.7g}" for row in table.tolist()]
        text = "\n".join([",".join(header), *rows]) + "\n"
        (folder / f"trial_{i}.csv").write_text(text, encoding="utf-8")
    path = folder / "rig.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
