# SPDX-License-Identifier: GPL-3.0-or-later
"""The registry of effects: finds every module of the library by its ``KIND``, and makes, checks and orders effects."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ...errors import EffectError, suggestion
from ...geometry.texels import Texels
from ...model.scenario import Scenario
from ...model.sensor import Effect, Sensor, Value
from .specification import SITES_OF_ACTION, Form, Kind

LIBRARY = f"{__package__.rpartition('.')[0]}.library"
"""Name of the package whose modules are the effects."""


@cache
def library() -> dict[str, Kind]:
    """Return every kind by its standard name, in the order in which the kinds act."""
    package = importlib.import_module(LIBRARY)
    found = [importlib.import_module(f"{LIBRARY}.{module.name}").KIND for module in pkgutil.iter_modules(package.__path__)]
    found.sort(key=lambda kind: (SITES_OF_ACTION.index(kind.site), kind.order, kind.name))
    return {kind.name: kind for kind in found}


def kind_of(name: str) -> Kind:
    """Return the kind with a standard name; raise :class:`EffectError` if there is none."""
    kinds = library()
    if name not in kinds:
        raise EffectError(f"There is no effect '{name}'{suggestion(name, kinds)}; the library has {', '.join(kinds)}.")
    return kinds[name]


def names_where(condition: Callable[[Kind], bool]) -> tuple[str, ...]:
    """Return the names of the kinds for which a condition holds, in the order in which they act."""
    return tuple(name for name, kind in library().items() if condition(kind))


def only_name_where(condition: Callable[[Kind], bool]) -> str:
    """Return the name of the one kind for which a condition holds; raise :class:`EffectError` if there is none or several."""
    names = names_where(condition)
    if len(names) != 1:
        text = f"{' and '.join(names)} state" if names else "no effect states"
        raise EffectError(f"Of the library {text} what exactly one effect has to state: compare their KINDs.")
    return names[0]


def names_known_from(feature: str) -> tuple[str, ...]:
    """Return the names of the kinds that are known from a feature of recordings, one of :data:`.specification.FEATURES`."""
    return names_where(lambda kind: feature in kind.known_from)


def names_in_family(family: str) -> tuple[str, ...]:
    """Return the names of the kinds of a family, one of :data:`.specification.FAMILIES`."""
    return names_where(lambda kind: family in kind.families)


def names_found_by(way: str) -> tuple[str, ...]:
    """Return the names of the kinds that are found in one way, one of :data:`.specification.FOUND_BY`."""
    return names_where(lambda kind: kind.found_by == way)


def form_of(name: str, form: str = "") -> Form:
    """Return a form by its name, or the usual form if no name is given; raise :class:`EffectError` if there is none."""
    forms = kind_of(name).forms_by_name
    if not form:
        return next(iter(forms.values()))
    if form not in forms:
        raise EffectError(f"Effect '{name}' has no form '{form}'{suggestion(form, forms)}; it has {', '.join(forms)}.")
    return forms[form]


def site_of_action(effect: Effect) -> str:
    """Return the site of action of an effect."""
    return kind_of(effect.name).site_of(form_of(effect.name, effect.form))


def effect(name: str, form: str = "", seed: int = 0, gain: float = 1.0, **values: Any) -> Effect:
    """Return a complete effect, with the usual form and default values for what is not given.

    Parameters
    ----------
    name, form : str
    seed : int
    gain : float
        Of the sensor that gets the effect (units per newton); some defaults scale with it.
    **values
        Parameters by name: a number, or one number per texel.

    Raises
    ------
    EffectError
        A name, form or parameter is unknown, or a value is outside its bounds.
    """
    found = form_of(name, form)
    complete: dict[str, Value] = found.defaults(gain)
    complete.update({key: _plain(value) for key, value in values.items()})
    made = Effect(name, found.name, complete, seed)
    check((made,), "the sensor", gain=gain)
    return made


def complete_values(item: Effect, gain: float = 1.0) -> dict[str, Value]:
    """Return an effect's value of every parameter, defaults included."""
    return {**form_of(item.name, item.form).defaults(gain), **item.values}


def check(effects: Iterable[Effect], sensor: str, texels: int | None = None, gain: float = 1.0) -> None:
    """Raise :class:`EffectError` for the first effect that is unknown or has a value that is not allowed.

    Parameters
    ----------
    effects : iterable of Effect
    sensor : str
        Name of the sensor, for the message.
    texels : int, optional
        Number of texels, which lists of values must have.
    gain : float
        Of the sensor, units per newton.
    """
    for item in effects:
        form = form_of(item.name, item.form)
        where = f"effect '{item.name}' ({form.name}) of sensor '{sensor}'"
        known = {parameter.name: parameter for parameter in form.parameters}
        for key, value in item.values.items():
            if key not in known:
                raise EffectError(f"{key} is no parameter of {where}{suggestion(key, known)}; it has {', '.join(known)}.")
            parameter = known[key].scaled(gain)
            numbers = np.asarray(value, dtype=float)
            if numbers.ndim and not parameter.per_texel:
                raise EffectError(f"{key} of {where} is a list of {numbers.size}: give it one number.")
            if numbers.ndim and texels is not None and len(numbers) != texels:
                raise EffectError(f"{key} of {where} has {len(numbers)} numbers for {texels} texels: give one per texel.")
            low, high = parameter.low - 1e-9 * abs(parameter.low), parameter.high + 1e-9 * abs(parameter.high)  # rounding
            outside = ~((numbers >= low) & (numbers <= high))
            if outside.any():
                worst = float(np.atleast_1d(numbers)[np.atleast_1d(outside)][0])
                unit = "" if parameter.unit == "1" else f" {parameter.unit}"
                raise EffectError(
                    f"{key} of {where} is {worst:g}{unit}: give it a value from {parameter.low:g} to {parameter.high:g}{unit}."
                )


def in_signal_order(effects: Iterable[Effect], readout: bool) -> list[tuple[Effect, Form]]:
    """Return the effects of a sensor in the order in which they act.

    Parameters
    ----------
    effects : iterable of Effect
    readout : bool
        Return the effects on readings if true, and those on contact forces otherwise.
    """
    chosen = []
    for item in effects:
        kind, form = kind_of(item.name), form_of(item.name, item.form)
        site = kind.site_of(form)
        if (site == "readout") == readout:
            rank = (form.after_conversion, form.after_clip, site == "pad", kind.order)
            chosen.append((rank, item, form))
    chosen.sort(key=lambda entry: entry[0])  # stable: of two equal ranks the first in the stack acts first
    return [(item, form) for _, item, form in chosen]


def actual_placement(
    effects: Iterable[Effect], position: np.ndarray, normal: np.ndarray, tangent: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return where the texels really are, given the effects that move them.

    Parameters
    ----------
    effects : iterable of Effect
    position : (n, 3) float, m
    normal, tangent : (n, 3) float
        Outward normal and x axis of each texel.

    Returns
    -------
    position, normal, tangent : (n, 3) float
        The arrays given, if no effect moves the texels.
    """
    for item, form in in_signal_order(effects, readout=False):
        if form.placement is not None:
            position, normal, tangent = form.placement(position, normal, tangent, complete_values(item))
    return position, normal, tangent


def to_dict(item: Effect) -> dict[str, Any]:
    """Return an effect as a TOML table: ``name``, ``form``, the values, and ``seed`` if the form draws random numbers."""
    seed = {"seed": item.seed} if form_of(item.name, item.form).random else {}
    values = {key: list(value) if isinstance(value, tuple) else value for key, value in item.values.items()}
    return {"name": item.name, "form": item.form, **seed, **values}


def from_dict(table: Mapping[str, Any], gain: float = 1.0) -> Effect:
    """Return the effect that a TOML table describes; raise :class:`EffectError` if it is not valid."""
    rest = dict(table)
    name, form, seed = rest.pop("name", None), rest.pop("form", ""), rest.pop("seed", 0)
    if not isinstance(name, str) or not isinstance(form, str):
        raise EffectError('An effect needs name = "…", one of the library\'s, and may have form = "…".')
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 2**31:
        raise EffectError(f"seed of effect '{name}' is {seed!r}: give it a whole number from 0 to 2147483647.")
    for key, value in rest.items():
        numbers = value if isinstance(value, list | tuple) else [value]
        if not all(_is_number(number) for number in numbers):
            raise EffectError(f"{key} of effect '{name}' is {value!r:.80}: give it a number.")
    return effect(name, form, seed, gain, **rest)


def _is_number(value: Any) -> bool:
    """Return whether a value of a file is a number that a float can hold, NaN and infinity included."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return isinstance(value, float) or abs(value) < 1 << 1023


def _plain(value: Any) -> Value:
    """Return a number, or numbers as a tuple, from any kind of array."""
    numbers = np.asarray(value, dtype=float)
    return float(numbers) if numbers.ndim == 0 else tuple(float(number) for number in numbers.ravel())


def check_scenario(scenario: Scenario) -> None:
    """Raise a :class:`PalpateError` when a scenario cannot be run or an effect of a sensor is not valid.

    Parameters
    ----------
    scenario : Scenario

    Raises
    ------
    PalpateError
        See :meth:`.Scenario.check` and :func:`check`.
    """
    scenario.check()
    for sensor in scenario.sensors:
        check(sensor.effects, sensor.name, len(sensor.texels), sensor.parameters.gain)


def mounted_texels(sensor: Sensor) -> Texels:
    """Return the texels of a sensor where its effects put them, in the frame of its body.

    Effects such as misalignment move texels. Without such an effect the sensor's own texels are returned.
    """
    texels = sensor.texels
    position, normal, tangent = actual_placement(sensor.effects, texels.position, texels.normal, texels.tangent)
    return texels if position is texels.position else replace(texels, position=position, normal=normal, tangent=tangent)
