# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: ``palpate COMMAND …``, and the same as ``blender --command palpate COMMAND …``.

Exit status: 0 done, 1 something the user can put right (one line on stderr), 2 wrong usage, 130 stopped with Ctrl-C, 141 the
program that read the output has gone (as ``head`` does).
"""

from __future__ import annotations

import argparse
import errno
import importlib
import os
import sys
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from typing import NoReturn

from ..core.errors import Cancelled, PalpateError, os_error_reason
from ..core.version import VERSION
from . import console

COMMANDS = {
    "demo": "build, bake and render the demo scene, and print the forces on the pads",
    "bake": "bake the sensors of a .blend to tactile images",
    "render": "make pictures, figures and a video of a baked scene",
    "export": "write a bake in the formats of other programs",
    "fit": "estimate stiffness and friction from measurements",
    "gap": "find the effects of a real sensor that its model lacks",
    "gap-table": "one table of the gaps of many rigs, beside models made by hand",
    "rig": "make a rig for gap from logs of a real sensor: CSV, MCAP, ROS bags, HDF5, NPZ, MAT",
    "paper": "repeat the experiments of the paper",
    "sweep": "simulate a scene thousands of times with varied parameters, resumable",
    "sensor": "write sensors for other simulators, and read theirs",
    "openrave": "read and write OpenRAVE sensor definitions",
}
"""Commands in the order of the help. This package has a module of each name, with _ for -."""

STOPPED, NO_READER = 130, 141
"""Exit statuses after Ctrl-C and after a closed pipe: 128 plus the number of the signal, as of other programs."""

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Numbers of the errors that a stream raises when what was printed cannot be stored."""


def run_process() -> NoReturn:
    """Run the command of this process and end the process with its exit status."""
    status = 1
    # The matrices are small: threads of BLAS would wait for each other, and round differently with each number of cores.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        status = main()
    except KeyboardInterrupt:
        status = STOPPED
    except BaseException:
        with suppress(OSError):
            sys.excepthook(*sys.exc_info())
    finally:
        console.end_process(status)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        The words after ``palpate``. Default: those of the process.

    Returns
    -------
    int
        The exit status.
    """
    prefix, stopped = "palpate:", "stopped; an earlier bake is unchanged."
    try:
        with console.Interrupt.noted():
            try:
                arguments = _parse(argv)
                prefix = f"palpate {arguments.command}:"
                stopped = getattr(arguments, "stopped", stopped)
                console.Interrupt.check()
                with console.kept(arguments) if arguments.command in console.COMMANDS else nullcontext():
                    status = arguments.run(arguments)
            except SystemExit as stop:  # argparse has printed its help or an error
                status = int(stop.code or 0)
            if sys.stdout is not None:
                sys.stdout.flush()
            return status
    except KeyboardInterrupt:
        return _say(prefix, stopped, STOPPED)
    except Cancelled as stop:
        return _say(prefix, stop, STOPPED)
    except PalpateError as error:
        return _say(prefix, error, 1)
    except MemoryError:
        return _say(prefix, "There is not enough memory: close other programs, or give fewer frames or texels.", 1)
    except BrokenPipeError:
        return NO_READER
    except OSError as error:
        if error.filename is not None or error.errno not in FULL:
            raise
        reason = os_error_reason(error)
        return _say(prefix, f"The output could not be written ({reason}): free some space or write to another place.", 1)


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Return the arguments; raise SystemExit after help and wrong usage."""
    words = sys.argv[1:] if argv is None else argv
    parser = _parser(words)
    arguments, rest = parser.parse_known_args(words)
    if arguments.command is None:
        parser.print_help(sys.stderr)
        raise SystemExit(2)
    if rest:
        _reject_unknown(parser, arguments.command, rest)
    return arguments


def _say(prefix: str, message: object, status: int) -> int:
    """Print why a command ends, and return its exit status."""
    with suppress(OSError):  # nobody may read stderr any more
        print(prefix, message, file=sys.stderr)
    return status


def _reject_unknown(parser: argparse.ArgumentParser, command: str, rest: list[str]) -> None:
    """Exit with a message about arguments that a command does not know."""
    if any(word.startswith("-") for word in rest):
        advice = f"palpate {command} --help lists its options"
    else:
        advice = f"palpate {command} takes one file at a time, so run it once for each"
    parser.error(f"unrecognized arguments: {' '.join(rest)}: {advice}")


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser of all commands, with the options of those that some words name.

    Each module has ``add_arguments(parser)`` and ``run(arguments)``; loading all of them takes longer than a short command.
    """
    parser = argparse.ArgumentParser(
        prog="palpate",
        description="Make any mesh a tactile sensor: simulate, bake and render contact forces.",
        epilog="palpate COMMAND --help says more about a command.",
    )
    parser.add_argument("--version", action="version", version=f"palpate {VERSION}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, summary in COMMANDS.items():
        sub = subparsers.add_parser(name, help=summary, description=f"{summary[0].upper()}{summary[1:]}.")
        if name not in words:
            continue
        module = importlib.import_module(f".{name.replace('-', '_')}", __package__)
        module.add_arguments(sub)
        if name in console.COMMANDS:
            console.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return parser
