# SPDX-License-Identifier: GPL-3.0-or-later
"""Set up a real Blender with a window for `make test-ui`, apart from the system it runs on.

A small Debian system with Blender from its own packages is unpacked into the user's cache folder and entered
with chroot, inside a mount and process namespace of its own: nothing is installed into the system except
`debootstrap`, no mount outlives the command, and deleting the folder undoes everything. What is already there is
kept, so a second run takes a moment and an interrupted one goes on. The package mirror is the one that this
system's apt is configured with.

    python tools/provision_blender.py                  set up Blender 4.3 (as root, on Debian; one to three minutes, 2 GB)
    python tools/provision_blender.py --blender 5.2    Blender 5.2, in a folder of its own
    python tools/provision_blender.py --shell          a shell inside
"""

from __future__ import annotations

import argparse
import contextlib
import fcntl
import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

KEYRING = Path("/usr/share/keyrings/debian-archive-keyring.gpg")
PACKAGES = [
    # python3-…: what an official Blender brings along and Debian's takes from the system
    *["blender", "python3-numpy", "python3-requests", "python3-zstandard", "python3-openimageio"],
    # software rendering
    *["libgl1-mesa-dri", "libegl-mesa0", "libegl1", "libgl1", "libglx-mesa0"],
    # a screen without a monitor, and pictures of it
    *["xvfb", "imagemagick", "x11-utils", "fonts-dejavu-core"],
]


@dataclass(frozen=True)
class Debian:
    """A Debian suite that carries a Blender, and what that Blender needs beyond PACKAGES."""

    suite: str
    python: str
    more: tuple[str, ...] = ()

    @property
    def packages(self) -> list[str]:
        """What is installed."""
        return [*PACKAGES, *self.more]


# Blender → the Debian that has it; both run on Debian's Python and on numpy 2
DEBIAN = {
    "4.3": Debian("trixie", "3.13"),
    # cattr: the extensions' own module imports it since 5.0
    "5.2": Debian("sid", "3.14", ("python3-cattr",)),
}
DEFAULT = "4.3"


class ProvisionError(Exception):
    """Blender cannot be set up here; the message says why and what to do."""


def folder(blender: str) -> Path:
    """Folder of the small Debian system with this Blender, as in "4.3"."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "palpate" / f"blender-{DEBIAN[blender].suite}"


def inside(argv: Sequence[str], root: Path, *, binds: Mapping[Path, str] | None = None) -> list[str]:
    """Return the command that runs `argv` inside the small system.

    Parameters
    ----------
    argv : sequence of str
        Command and arguments, with paths as seen inside.
    root : Path
        The system's folder.
    binds : mapping of Path to str, optional
        Folders of this system and where inside they appear.

    Returns
    -------
    list of str
        For `subprocess`. Ending that process ends everything it started inside.
    """
    script = ['root="$1"; shift', 'mount --rbind /dev "$root/dev"']
    script += [f'mount -t {kind} {kind} "$root/{name}"' for kind, name in (("proc", "proc"), ("tmpfs", "tmp"))]
    arguments = [str(root)]
    for outer, inner in (binds or {}).items():
        script.append('mkdir -p "$root$2"; mount --bind "$1" "$root$2"; shift 2')
        arguments += [str(outer), inner]
    script.append('exec chroot "$root" "$@"')
    clean = ["env", "-i", "PATH=/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin", "HOME=/root", "LANG=C.UTF-8"]
    clean += [f"{key}={value}" for key, value in os.environ.items() if key.lower().endswith("_proxy")]
    unshare = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "--"]
    return [*unshare, "sh", "-euc", "\n".join(script), "sh", *arguments, *clean, *argv]


def mirror() -> str:
    """Address of the Debian archive that this system's apt uses."""
    query = ["apt-get", "indextargets", "--format", "$(SITE) $(LABEL)", "Created-By: Packages"]
    run = subprocess.run(query, capture_output=True, text=True)
    sites = [line.partition(" ") for line in run.stdout.splitlines()]
    for site, _, label in sites:
        if label == "Debian":
            return site
    # the Label is known only after `apt-get update`; the address itself then has to do
    for site, _, _ in sites:
        if re.search(r"/debian/?$", site):
            return site
    raise ProvisionError(
        "This system's apt names no Debian archive, so there is nowhere to take Blender from; add one to its "
        "sources and run this again."
    )


def check_system() -> None:
    """Raise unless this is a system where Blender can be set up."""
    if not sys.platform.startswith("linux") or not shutil.which("apt-get"):
        raise ProvisionError("The window tests need Debian; on another system run them in a Debian 12 machine.")
    if os.geteuid() != 0:
        raise ProvisionError(
            "Setting up Blender for the window tests takes root, for chroot and mounts; run: sudo make test-ui"
        )
    if os.uname().machine != "x86_64":
        raise ProvisionError(f"The window tests run on x86_64 only; this machine is {os.uname().machine}.")


def say(text: str) -> None:
    """Tell what is being done."""
    print(text, flush=True)


def call(command: Sequence[str], log: Path, what: str) -> None:
    """Run a long command with its output in a log; raise with the log's end if it fails."""
    with log.open("a", encoding="utf-8") as out:
        code = subprocess.run(command, stdout=out, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL).returncode
    if code != 0:
        end = "\n".join(log.read_text(encoding="utf-8", errors="replace").splitlines()[-15:])
        raise ProvisionError(f"{what} failed; the end of {log}:\n{end}\nRun this again to go on from here.")


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Keep a second run from working on the same folder at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def install_debootstrap(log: Path) -> None:
    """Install what unpacks a Debian, unless it is there."""
    if shutil.which("debootstrap") and KEYRING.is_file():
        return
    say("Installing debootstrap …")
    call(["apt-get", "update", "-q"], log, "Updating the package lists")
    install = ["apt-get", "install", "-qy", "--no-install-recommends", "debootstrap", "debian-archive-keyring"]
    call(["env", "DEBIAN_FRONTEND=noninteractive", *install], log, "Installing debootstrap")


def check_candidate(blender: str, root: Path) -> None:
    """Raise unless the archive that the small system knows has this Blender, with the Python that is expected.

    Debian's sid moves on, and a mirror may lag behind or leave it out.
    """
    debian = DEBIAN[blender]
    for package, version in (("blender", blender), ("python3", debian.python)):
        query = subprocess.run(inside(["apt-cache", "policy", package], root), capture_output=True, text=True)
        found = re.search(r"Candidate: (?:\d+:)?(\S+)", query.stdout)
        there = found[1] if found else "none"
        if not there.startswith(f"{version}."):
            raise ProvisionError(
                f"Blender {blender} needs {package} {version}, but Debian {debian.suite} at {mirror()} has {there}; "
                f"use another mirror, or another Blender ({', '.join(DEBIAN)}), or amend DEBIAN in {Path(__file__).name}."
            )


def provision(blender: str = DEFAULT) -> Path:
    """Set up the small system with its Blender, or what is missing of it.

    Parameters
    ----------
    blender : str
        One of DEBIAN.

    Returns
    -------
    Path
        Its folder.

    Raises
    ------
    ProvisionError
        If this is not Debian, not root, or a package cannot be had.
    """
    check_system()
    debian, root = DEBIAN[blender], folder(blender)
    with locked(root.with_suffix(".lock")):
        log = root.with_suffix(".log")
        unpacked, installed = root / ".palpate-unpacked", root / ".palpate-installed"
        wanted = hashlib.sha256(" ".join(debian.packages).encode()).hexdigest()
        if installed.is_file() and installed.read_text() == wanted:
            return root
        log.unlink(missing_ok=True)
        if not unpacked.is_file():
            install_debootstrap(log)
            if root.exists():
                say("Removing what an interrupted run left …")
                shutil.rmtree(root)
            say(f"Unpacking a small Debian {debian.suite} into {root} …")
            start = time.monotonic()
            strap = ["debootstrap", "--variant=minbase", f"--keyring={KEYRING}", debian.suite, str(root), mirror()]
            call(["unshare", "--mount", *strap], log, "Unpacking Debian")
            unpacked.touch()
            say(f"  {time.monotonic() - start:.0f} s")
        say("Installing Blender and a virtual screen in it …")
        start = time.monotonic()
        install_blender(blender, root, log)
        installed.write_text(wanted)
        say(f"  {time.monotonic() - start:.0f} s")
    return root


def install_blender(blender: str, root: Path, log: Path) -> None:
    """Install Blender and the rest, if the archive has that Blender."""

    def step(*argv: str) -> None:
        call(inside(["env", "DEBIAN_FRONTEND=noninteractive", *argv], root), log, "Installing Blender")

    step("dpkg", "--configure", "-a")
    # sid's lists are good for a week, and some mirrors stand still for longer; their signature is checked all the same
    step("apt-get", "update", "-q", "-o", "Acquire::Check-Valid-Until=false")
    check_candidate(blender, root)
    step("apt-get", "install", "-qy", "--no-install-recommends", *DEBIAN[blender].packages)
    step("apt-get", "clean")


def main(argv: list[str] | None = None) -> int:
    """Set it up, and say what is there."""
    parser = argparse.ArgumentParser(description="Set up a real Blender for the window tests.")
    parser.add_argument("--blender", choices=list(DEBIAN), default=DEFAULT, help="which one (default: %(default)s)")
    parser.add_argument("--shell", action="store_true", help="then open a shell inside")
    args = parser.parse_args(argv)
    try:
        root = provision(args.blender)
    except ProvisionError as error:
        print(error, file=sys.stderr)
        return 1
    version = subprocess.run(inside(["blender", "--version"], root), capture_output=True, text=True, check=True)
    say(f"{version.stdout.splitlines()[0]} in {root}")
    if args.shell:
        return subprocess.run(inside(["bash"], root)).returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
