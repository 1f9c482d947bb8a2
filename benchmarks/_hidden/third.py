# SPDX-License-Identifier: GPL-3.0-or-later
"""A third family: each effect in a formula from the literature that neither the library nor :mod:`.other` has.

No rule of the search and no number in it may be set on these formulas. `strength` of 1 is strong, near 0 nothing. Docstrings
name the sources.
"""

from __future__ import annotations

import numpy as np

from .other import by_name
from .world import COLUMNS, DEEP, PITCH, ROWS, Hidden, N, faded


def _full(pad) -> float:
    """The reading of a texel pressed to :data:`DEEP`, less the zero."""
    return pad.gain * pad.k * DEEP


# --- contact


def stiffening(rng, strength) -> Hidden:
    """A block of rubber in compression (Mooney 1940, Rivlin 1948): stress 2 (1/λ² - λ) (C₁ + C₂/λ) at the stretch 1 - d/h."""
    height, second = 8e-3 / max(strength, 1e-6) ** 0.5, rng.uniform(0.0, 1.0)  # C₂ / C₁

    def act(s, pad):
        stretch = 1.0 - np.clip(s.depth / height, 1e-9, 0.8)
        stress = (stretch**-2 - stretch) * (1.0 + second / stretch)
        return s.force * stress / (3.0 * (1.0 - stretch) * (1.0 + second))

    return Hidden("stiffening", "mooney-rivlin", elastic=act)


def softening(rng, strength) -> Hidden:
    """Stress-softening of rubber by exp(-b √(M - m)) with the present strain m and the largest so far, M.

    Zúñiga and Beatty, Z. angew. Math. Phys. 53 (2002).
    """

    def act(s, pad):
        most = np.maximum.accumulate(s.depth, axis=0)
        return s.force * np.exp(-0.8 * strength * np.sqrt((most - s.depth) / DEEP))

    return Hidden("softening", "zuniga-beatty", elastic=act)


def hysteresis(rng, strength) -> Hidden:
    """The friction inside a rubber spring: from each reversal a hyperbola towards the largest friction force.

    Berg, Vehicle System Dynamics 30 (1998): with the displacement x and friction F at the reversal, α = F/Fₘ,
    F + (d - x) (Fₘ - F) / (x₂ (1 - α) + d - x) on the way in, and alike on the way out.
    """
    length = rng.uniform(0.1e-3, 0.4e-3)  # x₂, at which a first loading has half the friction
    share = min(0.25 * strength, 0.8)

    def act(s, pad):
        start, held, before, way = np.zeros(N), np.zeros(N), np.zeros(N), np.ones(N)
        friction = np.zeros(N)  # of the largest
        for t, depth in enumerate(s.depth):
            step = depth - before
            turned = step * way < 0.0
            start, held = np.where(turned, before, start), np.where(turned, friction, held)
            way = np.where(turned, -way, way)
            gone = np.abs(depth - start)
            friction = held + (way - held) * gone / np.maximum(length * (1.0 - way * held) + gone, 1e-12)
            free = depth <= 0.0
            start, held, friction = (np.where(free, 0.0, value) for value in (start, held, friction))
            way, before = np.where(free, 1.0, way), depth
            s.force[t] += share * pad.k * DEEP * friction
        return s.force

    return Hidden("hysteresis", "berg", elastic=act)


def _mittag_leffler(time: np.ndarray, order: float) -> np.ndarray:
    """E(-t^β) as ∫ exp(-r t) r^(β-1) sin(βπ) / (π (r^2β + 2 r^β cos βπ + 1)) dr (Gorenflo and Mainardi 1997, section 3)."""
    log = np.linspace(-30.0, 30.0, 1501)
    power = np.exp(order * log)
    spectrum = power * np.sin(np.pi * order) / (np.pi * (power**2 + 2.0 * power * np.cos(np.pi * order) + 1.0))  # per log r
    weights = spectrum * (log[1] - log[0])
    decayed: np.ndarray = np.exp(-np.outer(time, np.exp(log))) @ weights
    return decayed / weights.sum()


def creep(rng, strength) -> Hidden:
    """Stress relaxation of a standard solid with a fractional element: 1 - a (1 - E(-(t/τ)^β)), E of Mittag-Leffler.

    Bagley and Torvik, J. Rheol. 27 (1983); Koeller, J. Appl. Mech. 51 (1984).
    """
    tau, order = np.exp(rng.uniform(np.log(0.5), np.log(4.0))), rng.uniform(0.5, 0.85)

    def act(s, pad):
        memory = min(0.6 * strength, 0.95) * (1.0 - _mittag_leffler((s.time - s.time[0]) / tau, order))
        return s.force - faded(s.force, memory)

    return Hidden("creep", "fractional", elastic=act)


def adhesion(rng, strength) -> Hidden:
    """An exponential cohesive law, u exp(1 - u) with u = depth/width, on the way out, stronger the faster it opens.

    Xu and Needleman, J. Mech. Phys. Solids 42 (1994); the speed's power 0.6: Maugis and Barquins, J. Phys. D 11 (1978).
    """
    width, pace = rng.uniform(0.3e-3, 0.7e-3), rng.uniform(2e-3, 8e-3)

    def act(s, pad):
        touched = np.maximum.accumulate(s.depth, axis=0) > width
        opening = np.maximum(-s.contact.pace, 0.0)
        u = s.depth / width
        pull = strength * pad.k * 0.6e-3 * u * np.exp(1.0 - u) * (1.0 + (opening / pace) ** 0.6)
        return s.force - np.where(touched & (opening > 0.0) & (s.depth > 0.0), pull, 0.0)

    return Hidden("adhesion", "xu-needleman", force=act)


def wear(rng, strength) -> Hidden:
    """Fatigue: each loading to a peak p uses up (p/F)^m of the stiffness, as Basquin (1910) and Miner (1945) count cycles."""
    power = rng.uniform(2.0, 4.0)

    def act(s, pad):
        peaks = np.maximum(s.force, 0.0) / (pad.k * DEEP)
        used = np.cumsum(np.maximum(np.diff(peaks**power, axis=0, prepend=0.0), 0.0), axis=0)
        before = np.vstack([np.zeros((1, N)), used[:-1]])
        return s.force * np.maximum(1.0 - 0.2 * strength * before, 0.1)

    return Hidden("wear", "basquin", elastic=act)


# --- from texel to texel


def load_spreading(rng, strength) -> Hidden:
    """A stiff plate on the soft texels: each load sinks it by -kei(r/ℓ), Kelvin's function, which keeps the sum of the forces.

    Hertz, Ann. Phys. 258 (1884); Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells (1959), section 57.
    """
    from scipy.special import kei

    length = 2.5e-3 * strength

    def act(s, pad):
        apart = np.linalg.norm(pad.place[:, None] - pad.place[None], axis=2) / length
        shares = -kei(apart)
        shares[apart > 30.0] = 0.0
        shares /= shares.sum(axis=0)
        return pad.zero + (s.reading - pad.zero) @ shares.T

    return Hidden("load-spreading", "plate", reading=act)


def crosstalk(rng, strength) -> Hidden:
    """Sneak currents in a matrix of resistors: what flows through three loaded texels to the one that is read.

    The texels (i, l), (k, l) and (k, j) in series, for all other rows k and columns l; D'Alessio, Sensors and Actuators A 72
    (1999). Insulation between lines lets a part of it pass.
    """

    def act(s, pad):
        g = np.maximum((s.reading - pad.zero).reshape(-1, ROWS, COLUMNS), 0.0)
        (loaded,) = np.nonzero(g.any(axis=(1, 2)))
        held = g[loaded]
        if not len(held):
            return s.reading
        sneak = np.zeros_like(held)
        tiny = 1e-12 * held.max()
        for k, j in zip(*np.nonzero(held.any(axis=0)), strict=True):
            a, b, c = held[:, :, j, None], held[:, k, j, None, None], held[:, k, None, :]
            way = a * b * c / (a * b + b * c + a * c + tiny**2)
            way[:, k, :], way[:, :, j] = 0.0, 0.0
            sneak += way
        s.reading = s.reading.copy()
        s.reading[loaded] += 0.2 * strength * sneak.reshape(len(held), -1)
        return s.reading

    return Hidden("crosstalk", "sneak currents", reading=act)


# --- readout


def gain_mismatch(rng, strength) -> Hidden:
    """An amplifier with a tolerance for each row and each column, and a divider with a resistor of its own for each texel.

    The divider's hyperbola: Interlink Electronics, FSR Integration Guide. Dividers agree at one load.
    """
    row, column = rng.uniform(-1, 1, ROWS), rng.uniform(-1, 1, COLUMNS)
    gain = np.exp(0.45 * strength * (row[:, None] + column[None]).ravel())
    resistor = np.clip(0.15 * strength * rng.normal(size=N), -0.6, 0.6)

    def act(s, pad):
        x = (s.reading - pad.zero) / _full(pad)
        divided = x / np.maximum(1.0 + resistor * (np.abs(x) - 1.0), 0.2)
        return pad.zero + _full(pad) * gain / gain.mean() * divided

    return Hidden("gain-mismatch", "rows, columns and dividers", reading=act)


def dead_texels(rng, strength) -> Hidden:
    """A cut trace: neighbours in a line whose inputs float, and whose charge leaks away whatever presses on them."""
    count = int(np.clip(round(5 * strength), 1, 8))
    first, column = rng.integers(3, 12 - count), rng.integers(1, COLUMNS - 1)
    dead = (first + np.arange(count)) * COLUMNS + column
    level, tau = 0.2 * rng.uniform(-1, 1, count), np.exp(rng.uniform(np.log(3.0), np.log(30.0), count))

    def act(s, pad):
        s.reading[:, dead] = pad.zero + _full(pad) * level * np.exp(-(s.time - s.time[0])[:, None] / tau)
        return s.reading

    return Hidden("dead-texels", "floating", reading=act)


def dead_zone(rng, strength) -> Hidden:
    """A threshold as of a transistor: w ln(1 + exp((f - F)/w)), less its value without load.

    Enz, Krummenacher and Vittoz, Analog Integr. Circuits Signal Process. 8 (1995).
    """
    sharp = rng.uniform(0.15, 0.35)  # w / F

    def act(s, pad):
        threshold = pad.k * 1.2e-3 * strength
        width = sharp * threshold
        f = np.maximum(s.reading - pad.zero, 0.0) / pad.gain
        read = width * (np.logaddexp(0.0, (f - threshold) / width) - np.logaddexp(0.0, -threshold / width))
        return pad.zero + pad.gain * read

    return Hidden("dead-zone", "softplus", reading=act)


def saturation(rng, strength) -> Hidden:
    """An amplifier that comes to its limit as x / (1 + |x|^p)^(1/p) (Rapp, Proc. 2nd European Conf. Satellite Comm., 1991)."""
    sharp = rng.uniform(1.6, 4.0)

    def act(s, pad):
        top = pad.gain * pad.k * 2.5e-3 / strength
        x = (s.reading - pad.zero) / top
        return pad.zero + top * x / (1.0 + np.abs(x) ** sharp) ** (1.0 / sharp)

    return Hidden("saturation", "rapp", reading=act)


def lag(rng, strength) -> Hidden:
    """The filter of a sigma-delta converter: three moving averages in a row (Hogenauer, IEEE Trans. ASSP 29, 1981)."""
    width = 0.25 * strength  # s, of each average

    def act(s, pad):
        fine = 16  # steps in which the averages are integrated, of a sample
        box = np.ones(max(round(width * fine / s.dt), 1))
        weights = np.convolve(np.convolve(box, box), box)
        delay = np.arange(len(weights)) * s.dt / fine
        weights /= weights.sum()
        whole = np.floor(delay / s.dt).astype(int)
        part = delay / s.dt - whole
        taps = np.zeros(whole[-1] + 2)  # readings are straight between samples
        np.add.at(taps, whole, weights * (1.0 - part))
        np.add.at(taps, whole + 1, weights * part)
        padded = np.vstack([np.repeat(s.reading[:1], len(taps) - 1, axis=0), s.reading])
        n = len(padded) + len(taps)
        late = np.fft.irfft(np.fft.rfft(padded - padded[0], n, axis=0) * np.fft.rfft(taps, n)[:, None], n, axis=0)
        return padded[0] + late[len(taps) - 1 : len(padded)]

    return Hidden("lag", "three averages", reading=act)


def drift(rng, strength) -> Hidden:
    """Ageing, A ln(1 + B t), as of crystals and references (MIL-PRF-55310), a tenth different from texel to texel."""
    rate, spread = np.exp(rng.uniform(np.log(0.1), np.log(1.0))), 1.0 + 0.1 * rng.normal(size=N)
    amount = 0.2 * strength * rng.choice([-1, 1])

    def act(s, pad):
        course = np.log1p(rate * (s.time - s.time[0])) / np.log1p(rate * 25.0)
        return s.reading + _full(pad) * amount * course[:, None] * spread

    return Hidden("drift", "ageing", reading=act)


def offset(rng, strength) -> Hidden:
    """A board that is bent, and an amplifier with an offset for each column.

    A number that never changes has no other formula; only its pattern over the pad is another one.
    """
    y, x = np.mgrid[-1 : 1 : ROWS * 1j, -1 : 1 : COLUMNS * 1j]
    bent = rng.normal() * y**2 + rng.normal() * x * y + rng.normal() * x**2
    zero = (bent - bent.mean() + 0.7 * rng.normal(size=COLUMNS)).ravel()
    return Hidden("offset", "bent board", reading=lambda s, pad: s.reading + 0.2 * strength * _full(pad) * zero)


def quantization(rng, strength) -> Hidden:
    """A converter that ranges its gain: steps double above a quarter of the range and again above half (ITU-T G.711)."""

    def act(reading, pad):
        x = (reading - pad.zero) / _full(pad)
        step = 0.15 * strength * np.where(np.abs(x) > 0.5, 4.0, np.where(np.abs(x) > 0.25, 2.0, 1.0))
        return pad.zero + _full(pad) * step * np.round(x / step)

    return Hidden("quantization", "ranges", convert=act)


def noise(rng, strength) -> Hidden:
    """Shot noise (Schottky 1918): so many charges as the reading has, counted by Poisson's law."""

    def act(s, pad):
        charge = 0.1 * strength**2 * _full(pad)
        x = s.reading - pad.zero
        return pad.zero + np.sign(x) * charge * rng.poisson(np.abs(x) / charge)

    return Hidden("noise", "shot", reading=act)


def misalignment(rng, strength) -> Hidden:
    """The flexible circuit was glued on shifted and sheared."""
    turn, shear = rng.uniform(0, 2 * np.pi), 0.08 * strength * rng.choice([-1, 1])
    by = PITCH * strength * np.array([np.cos(turn), np.sin(turn)])

    def place(places):
        return places + by + shear * np.stack([places[:, 1], np.zeros(len(places))], axis=1)

    return Hidden("misalignment", "shift and shear", place=place)


# --- friction


def stribeck(rng, strength) -> Hidden:
    """Friction falls with the hyperbolic tangent of the speed (Makkar et al., Conf. Adv. Intell. Mechatronics, 2005)."""
    rise, slow = min(1.5 * strength, 3.8), np.exp(rng.uniform(np.log(5e-3), np.log(0.03)))

    def law(speed, fn, pad):
        return 1.0 + rise * (1.0 - np.tanh(speed / slow)), np.zeros_like(speed)

    return Hidden("stribeck", "tanh", friction=law)


def viscous_friction(rng, strength) -> Hidden:
    """Shear of a film by jumps of its molecules, asinh(v/V) (Eyring, J. Chem. Phys. 4, 1936), over Hertz's area, f^(2/3)."""
    slow = np.exp(rng.uniform(np.log(5e-3), np.log(0.03)))

    def law(speed, fn, pad):
        load = np.maximum(fn, 0.0) ** (2 / 3) * (pad.k * DEEP) ** (1 / 3)
        v = np.maximum(speed, 1e-6)
        return np.ones_like(speed), 0.5 * strength * load * np.arcsinh(v / slow) / v

    return Hidden("viscous-friction", "eyring", friction=law)


THIRD = by_name(
    stiffening, softening, hysteresis, creep, adhesion, wear, load_spreading, crosstalk, gain_mismatch, dead_texels, dead_zone,
    saturation, lag, drift, offset, quantization, noise, misalignment, stribeck, viscous_friction,
)  # fmt: skip
