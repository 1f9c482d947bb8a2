# SPDX-License-Identifier: GPL-3.0-or-later
"""Laws as functions of Warp: the bits of their own source, for contact, friction and every effect with a law."""

from __future__ import annotations

import ast
import importlib.metadata
import inspect
import math

import numpy as np
import pytest

from palpate.core.compiled.kernels import inlined, plain
from palpate.core.effects.engine.registry import complete_values, effect, form_of, library
from palpate.core.effects.engine.specification import TexelInput
from palpate.core.errors import PalpateError
from palpate.core.geometry import shapes
from palpate.core.geometry.shapes import is_in_shape, shape_distance, shape_entry, shape_normal
from palpate.core.laws.contact_law import ContactLaw, read_law, scaled_law, whole_texel_law, with_friction
from palpate.core.laws.friction import (
    bristle_rate,
    bristle_step,
    decay_and_mean,
    deflection_scale,
    friction_force,
    friction_tangent,
    max_bristle_deflection,
    next_deflection,
    stribeck_coefficient,
    turned_into_plane,
)
from palpate.core.laws.normal_force import (
    damped_force,
    damped_force_derivatives,
    damping_coefficient,
    elastic_force,
    elastic_stiffness,
    hunt_crossley_damping,
    linear_tangent,
    normal_force,
    normal_tangent,
)
from palpate.core.simulators.warp import engine
from palpate.core.simulators.warp.press_arrays import IntArray
from palpate.core.simulators.warp.translation import Translation, TranslationError, _Unrolled

warp = pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")
COLUMNS = 40


def contact_laws(i: int, x: np.ndarray, table: np.ndarray, out: np.ndarray) -> None:
    """Write the values of every law of core/laws at a row of numbers from 0 to 1."""
    law = read_law(table, i)
    depth, rate, speed, dt = 0.01 * x[i, 0], x[i, 1] - 0.5, x[i, 2], 0.01 * x[i, 3] + 1e-5
    out[i, 0], out[i, 1] = decay_and_mean(50.0 * x[i, 4])
    out[i, 2] = stribeck_coefficient(speed * speed, law)
    keep, gain = bristle_step(speed * speed, x[i, 5], dt, law)
    out[i, 3], out[i, 4] = keep, gain
    out[i, 5] = next_deflection(keep, x[i, 6], gain, rate)
    zx, zy, zz = turned_into_plane((x[i, 0], x[i, 1], x[i, 2]), (0.6, 0.0, 0.8))
    out[i, 6], out[i, 7], out[i, 8] = zx, zy, zz
    out[i, 9] = max_bristle_deflection(x[i, 5], law)
    out[i, 10] = deflection_scale(x[i, 6], x[i, 7])
    out[i, 11] = bristle_rate(x[i, 6], rate, speed * speed, x[i, 5] - 0.2, law)
    out[i, 12] = friction_force(x[i, 6], x[i, 7], rate, law)
    out[i, 13], out[i, 14] = friction_tangent(keep, gain, x[i, 7], dt, law)
    out[i, 15] = hunt_crossley_damping(x[i, 0])
    force = elastic_force(depth, law)
    out[i, 16], out[i, 17] = force, elastic_stiffness(depth + 1e-9, force, law)
    out[i, 18], out[i, 19] = damping_coefficient(law), damped_force(force, rate, law)
    out[i, 20], out[i, 21], out[i, 22] = damped_force_derivatives(force, x[i, 5], x[i, 6], rate, x[i, 7] > 0.5)
    out[i, 23] = normal_force(depth - 0.005, rate, law)
    out[i, 24], out[i, 25] = linear_tangent(depth, dt, law)
    out[i, 26], out[i, 27] = normal_tangent(depth - 0.002, rate, dt, law)
    other = whole_texel_law(scaled_law(with_friction(law, x[i, 0], x[i, 1]), x[i, 2], x[i, 3]), 0.25, x[i, 4] + 0.1)
    out[i, 28], out[i, 29], out[i, 30], out[i, 31], out[i, 32] = other.k, other.cn, other.ct, other.mus, other.dissipation


def table_of_laws(draw, count):
    """Laws of all kinds: linear in half of the rows."""
    table = draw.random((count, len(ContactLaw._fields)))
    exponent = ContactLaw._fields.index("exponent")
    table[:, exponent] = np.where(np.arange(count) % 2, 0.0, 1.0 + table[:, exponent])
    return table


@pytest.mark.slow("Warp compiles the laws")
def test_laws_of_contact_have_the_bits_of_their_source():
    draw, count = np.random.default_rng(1), 400
    x, table, expected = draw.random((count, 8)), table_of_laws(draw, count), np.zeros((count, COLUMNS))
    x[:20] = 0.0  # nothing moves, nothing presses
    for i in range(count):
        contact_laws(i, x, table, expected)
    translation = Translation(warp, warp.float64, "test_laws")
    arrays = [translation.array(values, "cpu") for values in (x, table, np.zeros_like(expected))]
    warp.launch(translation.kernel(contact_laws, 1), dim=count, inputs=arrays, device="cpu")
    found = arrays[2].numpy()
    assert np.count_nonzero(expected.any(axis=0)) == 33
    assert np.array_equal(found, expected, equal_nan=True)


def shape_functions(i: int, kind: IntArray, x: np.ndarray, out: np.ndarray) -> None:
    """Write the values of every function of shapes at a row of a size, a point and a unit vector."""
    enters, axis = shape_entry(kind[i], (x[i, 0], x[i, 1], x[i, 2]), (x[i, 3], x[i, 4], x[i, 5]), (x[i, 6], x[i, 7], x[i, 8]))
    nx, ny, nz = shape_normal(kind[i], (x[i, 0], x[i, 1], x[i, 2]), axis, (x[i, 3], x[i, 4], x[i, 5]))
    out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = enters, float(axis), nx, ny, nz
    out[i, 5] = 1.0 if is_in_shape(kind[i], (x[i, 0], x[i, 1], x[i, 2]), (x[i, 3], x[i, 4], x[i, 5])) else 0.0
    out[i, 6] = shape_distance(kind[i], (x[i, 0], x[i, 1], x[i, 2]), (x[i, 3], x[i, 4], x[i, 5]))


@pytest.mark.slow("Warp compiles the functions")
def test_shapes_have_the_bits_of_their_source():
    """Lines in all directions and along the axes, which lead beside the faces of a box and along the axis of a capsule."""
    draw, count = np.random.default_rng(3), 800
    x, kind, expected = draw.normal(size=(count, 9)), 1 + np.arange(count) % 4, np.zeros((count, 7))
    x[:, :3] = np.abs(x[:, :3]) + 0.1
    x[:200, 6:] = np.repeat([*np.eye(3), *-np.eye(3)], 34, axis=0)[:200]
    x[:, 6:] /= np.linalg.norm(x[:, 6:], axis=1, keepdims=True)
    for i in range(count):
        shape_functions(i, kind, x, expected)
    translation = Translation(warp, warp.float64, "test_shapes")
    arrays = [translation.array(values, "cpu") for values in (kind, x, np.zeros_like(expected))]
    warp.launch(translation.kernel(shape_functions, 1), dim=count, inputs=arrays, device="cpu")
    assert np.array_equal(arrays[2].numpy(), expected)
    for one in (shapes.SPHERE, shapes.BOX, shapes.CAPSULE, shapes.PLANE):
        met = np.isfinite(expected[kind == one, 0]).sum()
        assert 50 < met < 200 and 20 < expected[kind == one, 5].sum() < 180, (one, met)


def test_the_name_of_an_unrolled_loop_is_a_variable_behind_it():
    source = ast.parse("for i in PAIR:\n    a(i)\nfor i in range(3):\n    b(i)")
    assert ast.unparse(_Unrolled({"PAIR": (0, 3)}).visit(source)) == "a(0)\na(3)\nfor i in range(3):\n    b(i)"


def stand_in(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """Stand for a law."""
    return texel.force, texel.slope


def over_time(i: int, x: np.ndarray, constants: np.ndarray, state: np.ndarray, out: np.ndarray) -> None:
    """Bring one texel through all steps of a signal (t, 4), and evaluate each step before it is taken."""
    for step in range(x.shape[0]):
        texel = TexelInput(x[step, 0], x[step, 1], x[step, 2], x[step, 3])
        out[step, 0], out[step, 1] = stand_in(texel, constants, state, False)
        out[step, 2], out[step, 3] = stand_in(texel, constants, state, True)


LAWS = [(kind.name, form.name) for kind in library().values() for form in kind.forms if form.law is not None]


@pytest.mark.long("Warp compiles every law of the library, one module each")
@pytest.mark.parametrize(("name", "form"), LAWS)
def test_laws_of_effects_have_the_numbers_of_their_source(name, form):
    """To 1e-14 of the largest: a compiler may call another exp or pow than Python."""
    chosen = form_of(name, form)
    draw, steps = np.random.default_rng(2), 60
    x = draw.random((steps, 4)) * np.array([0.3, 200.0, 1e-3, 1e-4])
    x[::7, :] = 0.0  # let go
    constants = chosen.constants(complete_values(effect(name, form)), np.array([0.01]))[0]
    expected, state = np.zeros((steps, 4)), np.zeros(max(chosen.state_size, 1))
    for step in range(steps):
        texel = TexelInput(*x[step])
        expected[step, :2] = chosen.law(texel, constants, state, False)
        expected[step, 2:] = chosen.law(texel, constants, state, True)
    label = f"test_{name}_{form}".replace("-", "_")
    translation = Translation(warp, warp.float64, label, {"stand_in": chosen.law})
    arrays = [translation.array(v, "cpu") for v in (x, constants, np.zeros_like(state), np.zeros((steps, 4)))]
    warp.launch(translation.kernel(over_time, 1), dim=1, inputs=arrays, device="cpu")
    assert arrays[3].numpy() == pytest.approx(expected, abs=1e-14 * np.abs(expected).max(), rel=1e-13)
    assert arrays[2].numpy() == pytest.approx(state, abs=1e-14 * np.abs(state).max(), rel=1e-13)


def test_the_library_has_laws_to_translate():
    assert len(LAWS) > 20


def test_what_has_no_translation_is_named():
    def sorts(x: np.ndarray) -> float:
        with math:
            return 0.0

    def counts(x: object) -> float:
        return 0.0

    def gammas(x: float) -> float:
        return math.gamma(x)

    translation = Translation(warp, warp.float64, "test_refused")
    for function, words in ((sorts, "'with math"), (counts, "annotated 'object'"), (gammas, "no function 'gamma'")):
        with pytest.raises(TranslationError, match=words):
            translation.function(function)


def test_the_source_of_a_kernel_of_numba_is_found():
    assert plain(inlined(stand_in)) is stand_in
    assert "return" in inspect.getsource(plain(decay_and_mean))


@pytest.mark.parametrize(
    ("version", "words"),
    [
        (None, r"^A sensor on Warp needs warp, which is not installed: run 'pip install warp-lang'\.$"),
        ("1.2.3", r"^warp is version 1\.2\.3, and a sensor on Warp needs .*: run 'pip install --upgrade warp-lang'\.$"),
    ],
)
def test_warp_that_is_missing_or_old_is_one_sentence(monkeypatch, version, words):
    if version is None:
        monkeypatch.setitem(__import__("sys").modules, "warp", None)
    monkeypatch.setattr(importlib.metadata, "version", lambda _: version)
    with pytest.raises(PalpateError, match=words):
        engine.require_warp()
