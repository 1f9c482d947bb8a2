# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate fit``: fits parameters of a sensor to measurements of its foam and of its friction, and read-outs to rigs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..core.errors import counted
from ..core.figures.figure_canvas import file_type
from ..core.io.file_writing import writable_file
from ..core.model.sensor_parameters import DAMPING_PER_STIFFNESS, unit_of
from . import checks, console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    kinds = parser.add_subparsers(dest="kind", metavar="stiffness | friction | readout", required=True)
    foam = kinds.add_parser(
        "stiffness",
        help="stiffness k from the compression of the foam (Eq. 18)",
        description="Stiffness of one texel from foam measurements: a CSV with the columns compression (m) and pressure (Pa), "
        "force (N) or mass (kg). Other units are written into the header, as in 'compression (mm)'.",
    )
    foam.add_argument("file", metavar="FOAM.csv", help="compression under load")
    foam.add_argument("--area", type=float, required=True, metavar="M2", help="area of the whole sensor, m²")
    foam.add_argument("--texels", type=int, required=True, metavar="N", help="number of texels on it")
    foam.add_argument("--weight-area", type=float, metavar="M2", help="area on which the forces or masses rested, m²")
    foam.set_defaults(action=_stiffness)
    slide = kinds.add_parser(
        "friction",
        help="mus, mud, x0 and ct from a force–velocity curve (Eq. 13); sigma0 and sigma1 too where it has a time column",
        description="Friction of one texel: a CSV with the columns velocity (m/s) and force (N), each line in steady "
        "sliding, or with a column time (s) as well, recorded from rest.",
    )
    slide.add_argument("file", metavar="FRICTION.csv", help="friction force over velocity")
    slide.add_argument("--normal-force", type=float, required=True, metavar="N", help="normal force on one texel, N")
    slide.add_argument(
        "--texels", type=int, default=1, metavar="N", help="number of texels that shared the measured force (default: 1)"
    )
    slide.set_defaults(action=_friction)
    readout = kinds.add_parser(
        "readout",
        help="force and place from readings, with intervals",
        description="Read-outs from the recordings of a rig (docs/gap.md): what drove the sensor from its readings, by a "
        'forward model that is inverted, ridge regression and a Gaussian process, checked on recordings with use = "check".',
    )
    readout.add_argument("file", metavar="RIG", help="rig.toml, as palpate rig new writes it")
    readout.set_defaults(action=_readout)
    for kind in (foam, slide, readout):
        kind.add_argument("--plot", metavar="FILE", help="write a plot of measurements and fit: .png, .pdf or .svg")


def run(arguments: argparse.Namespace) -> int:
    if arguments.plot is not None:
        checks.outputs_are_no_inputs((arguments.plot,), (arguments.file,))
        file_type(arguments.plot)
        writable_file(arguments.plot)
    with console.Interrupt.raised_at_once():
        arguments.action(arguments)
    if arguments.plot:
        print(f"plot: {Path(arguments.plot).absolute()}")
    return 0


def _stiffness(arguments: argparse.Namespace) -> None:
    from ..api.fits import fit_stiffness

    fit = fit_stiffness(arguments.file, arguments.area, arguments.texels, arguments.weight_area)
    rows = [
        ("line", "k of one texel", "95 % interval", "offset"),
        ("through zero", f"{fit.k.value:.4g} N/m", f"{fit.k.low:.4g} to {fit.k.high:.4g}", "0 Pa"),
        ("with offset", f"{fit.k_offset.value:.4g} N/m", f"{fit.k_offset.low:.4g} to {fit.k_offset.high:.4g}", _pascals(fit)),
    ]
    number = len(fit.data.compression)
    print(f"{number} measurements from '{arguments.file}', {arguments.texels} texels on {arguments.area:g} m²\n")
    print(console.text_table(rows, "<>>>"))
    if fit.is_turned:
        print("\nCompressions and loads are negative, as testing machines write them: both were turned.")
    if fit.dead_zone > 0.0:
        print(f"\nThe foam has a dead zone of {fit.dead_zone * 1e3:.3g} mm, which the model's line")
        print("through zero does not have; add the effect dead-zone to the sensor for it.")
    if fit.stiffens:
        print(f"\nThe curve bends upwards: a square adds {fit.bend:.0%} to the line at its end, so that no single k is right;")
        print("add the effect stiffening to the sensor for it.")
    print(f"\nSuggested: k = {fit.k.value:.4g} N/m, cn = {DAMPING_PER_STIFFNESS * fit.k.value:.3g} N·s/m (1 % of k)")
    if arguments.plot:
        from ..core.gap.calibration.plots import plot_stiffness

        plot_stiffness(arguments.plot, fit)


def _pascals(fit: Any) -> str:
    return f"{fit.offset.value:.4g} Pa ({fit.offset.low:.4g} to {fit.offset.high:.4g})"


def _friction(arguments: argparse.Namespace) -> None:
    from ..api.fits import fit_friction

    fit = fit_friction(arguments.file, arguments.normal_force, arguments.texels)
    data = fit.data
    kind = "steady sliding" if data.time is None else f"a recording of {data.time[-1] - data.time[0]:.3g} s from rest"
    print(f"{len(data.force)} measurements from '{arguments.file}' as {kind}, {arguments.normal_force:g} N on a texel\n")
    rows = [("parameter", "value", "95 % interval", "unit")]
    for name, estimate in fit.estimates.items():
        unit = unit_of(name, "").removeprefix("1")  # no word for a number without a unit
        rows.append((name, f"{estimate.value:.4g}", f"{estimate.low:.4g} to {estimate.high:.4g}", unit))
    print(console.text_table(rows, "<>><"))
    print(f"\nroot mean square residual: {fit.residual:.3g} N")
    if fit.unidentifiable:
        print(f"These measurements do not identify {', '.join(fit.unidentifiable)}: add some at other velocities.")
    if arguments.plot:
        from ..core.gap.calibration.plots import plot_friction

        plot_friction(arguments.plot, fit)


def _readout(arguments: argparse.Namespace) -> None:
    from ..api.fits import fit_readout

    fit = fit_readout(arguments.file)
    data = fit.data
    print(
        f"{' and '.join(data.targets)} from {counted(len(data.channels), 'channel')}, fitted to "
        f"{counted(len(data.fit), 'recording')} and checked on {len(data.check)}\n"
    )
    rows = [("method", "of", "memory", "error left out", "error checked", "median", "in 95 % interval")]
    for one in fit.results:
        mark = "* " if one is fit.best else "  "
        for i, target in enumerate(data.targets):
            checked = "", "", ""
            if one.check is not None and one.check_median is not None and one.coverage is not None:
                checked = f"{one.check[i]:.3g}", f"{one.check_median[i]:.3g}", f"{one.coverage[i]:.0%}"
            memory = " and ".join(f"{tau:g} s" for tau in one.times) or "none"
            name = f"{target} ({data.unit(target)})"
            rows.append((f"{mark}{one.name}" if i == 0 else "", name, memory, f"{one.left_out[i]:.3g}", *checked))
    print(console.text_table(rows, "<<<>>>>"))
    print("\nErrors are root mean squares.")
    print("* is recommended: the simplest within one standard error of the smallest cross-validation error.")
    if fit.forward_check is not None:
        print(f"forward model: {fit.forward_check:.2%} of the readings' range on the check recordings")
    if not data.check:
        print('No recording has use = "check": the read-outs are not validated.')
    for note in [*data.notes, *fit.reasons]:
        print(f"note: {note}")
    if arguments.plot:
        from ..core.gap.calibration.plots import plot_readout

        plot_readout(arguments.plot, fit)
