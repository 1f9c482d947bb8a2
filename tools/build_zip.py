# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension zips: the package, its manifest and its wheels, one zip per platform and Python.

A zip for this machine's platform also carries the solver's machine code (tools/machine_code.py), if its Python is installed
here: its first use then takes a second instead of half a minute. Build each platform's zip on that platform to have it
everywhere.

Blender's installer picks wheels by platform only, so wheels for two Pythons must not share a zip. The same
sources and wheels give the same bytes. Each zip is validated by Blender's own tool, which comes with bpy.

    python tools/build_zip.py                                            all platforms and Pythons, into dist/
    python tools/build_zip.py --platform linux-x64 --python-version 3.11
    python tools/build_zip.py --website https://…                        for extensions.blender.org, into dist/upload/
    python tools/build_zip.py --local --python-version 3.13 --blender-min 4.2.0
                                                    for a distribution's Blender, which runs on its own Python
"""

from __future__ import annotations

import argparse
import email
import hashlib
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Mapping
from pathlib import Path

import tomli_w
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

ROOT = Path(__file__).resolve().parents[1]
WHEEL_LIST = ROOT / "tools" / "wheels.txt"
WHEEL_CACHE = ROOT / "build" / "wheels"
CODE_CACHE = ROOT / "build" / "machine-code"
MACHINE_CODE = "core/compiled/machine_code.bin"

# Blender's name of a platform → tags its wheels may carry; Blender too asks for glibc 2.28 and macOS 12.
PLATFORMS = {
    "linux-x64": [f"manylinux_2_{minor}_x86_64" for minor in (28, 27, 17)] + ["manylinux2014_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": [
        "macosx_12_0_arm64",
        "macosx_11_0_arm64",
        "macosx_10_13_universal2",
        "macosx_10_9_universal2",
    ],
}
# Python → the first Blender that ships it, and the first that no longer does.
BLENDER_RANGE = {"3.11": ("4.2.0", "5.1.0"), "3.13": ("5.1.0", None)}
# What a wheel's requirements are judged by on each platform
MARKERS = {
    "linux-x64": {"sys_platform": "linux", "platform_system": "Linux", "os_name": "posix", "platform_machine": "x86_64"},
    "windows-x64": {"sys_platform": "win32", "platform_system": "Windows", "os_name": "nt", "platform_machine": "AMD64"},
    "macos-arm64": {"sys_platform": "darwin", "platform_system": "Darwin", "os_name": "posix", "platform_machine": "arm64"},
}
# Python → the oldest numpy that a Blender on it ships, or that exists for it
NUMPY = {"3.11": "1.24.3", "3.13": "2.2.4", "3.14": "2.3.2"}
# The licence travels with the zip; everything else is in the package folders that pyproject.toml lists.
ROOT_FILES = ["__init__.py", "LICENSE"]
NOT_IN_ZIP = {"plugins", "sweep", "core/simulators/warp"}  # need packages that the zip does not carry
FIXED_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold


class BuildError(Exception):
    """The zip cannot be built; the message says why and what to do."""


def package_files() -> list[Path]:
    """Files of the package, relative to the repository root, without the manifest."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    folders = {package.split(".")[1] for package in project["tool"]["setuptools"]["packages"] if "." in package} - NOT_IN_ZIP
    files = [Path(name) for name in ROOT_FILES]
    for folder in sorted(folders):
        for path in sorted((ROOT / folder).rglob("*")):
            relative = path.relative_to(ROOT)
            hidden = any(part.startswith((".", "__pycache__")) for part in relative.parts)
            # `scene.blend1` is the copy Blender keeps of the file it saved over
            left_out = any(parent.as_posix() in NOT_IN_ZIP for parent in relative.parents)
            if path.is_file() and not hidden and not left_out and path.suffix not in {".pyc", ".blend1", ".blend2"}:
                files.append(relative)
    return files


def wheel_list(platform_name: str, python: str) -> list[str]:
    """Return the wheels of a platform and Python as ``name==version``; pip would judge the markers by its own Python."""
    lines = [line.split("#")[0].strip() for line in WHEEL_LIST.read_text(encoding="utf-8").splitlines()]
    wanted = [Requirement(line) for line in lines if line]
    environment = {**MARKERS[platform_name], "python_version": python, "python_full_version": f"{python}.0"}
    return [f"{one.name}{one.specifier}" for one in wanted if one.marker is None or one.marker.evaluate(environment)]


def wheels_for(platform_name: str, python: str) -> list[Path]:
    """Wheels of one platform and Python, fetched once and kept under build/."""
    folder = WHEEL_CACHE / f"{platform_name}-cp{python.replace('.', '')}"
    stamp = folder / ".complete"
    wanted = hashlib.sha256(WHEEL_LIST.read_bytes()).hexdigest()
    if not (stamp.is_file() and stamp.read_text() == wanted):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--only-binary=:all:", "--no-deps"]
        command += ["--implementation", "cp", "--python-version", python, "--dest", str(folder)]
        for tag in PLATFORMS[platform_name]:
            command += ["--platform", tag]
        run = subprocess.run([*command, *wheel_list(platform_name, python)], capture_output=True, text=True)
        if run.returncode != 0:
            raise BuildError(
                f"The wheels for {platform_name} and Python {python} could not be fetched; check the network "
                f"and the versions in {WHEEL_LIST.relative_to(ROOT)}. pip said:\n{run.stderr.strip()}"
            )
        stamp.write_text(wanted)
    return sorted(folder.glob("*.whl"))


def machine_code(platform_name: str, python: str, wheels: list[Path]) -> bytes | None:
    """Return the kernels' machine code, made once and kept under build/; None where it cannot be made on this machine.

    It is made by the zip's Python and wheels, and with the oldest numpy of its Blenders.
    """
    interpreter = _interpreter(python) if platform_name == _platform_here() else None
    if interpreter is None:
        return None
    digest = hashlib.sha256(WHEEL_LIST.read_bytes())
    for file in package_files():
        if file.parts[0] == "core" and file.suffix == ".py":
            digest.update((ROOT / file).read_bytes())
    kept = CODE_CACHE / f"{platform_name}-cp{python.replace('.', '')}-{digest.hexdigest()[:16]}.bin"
    if not kept.is_file():
        kept.parent.mkdir(parents=True, exist_ok=True)
        partial = kept.with_suffix(f".{os.getpid()}.partial")  # another process may make the same
        with tempfile.TemporaryDirectory() as folder:
            own = Path(folder) / ("Scripts" if platform_name == "windows-x64" else "bin") / "python"
            numpy = f"numpy=={NUMPY.get(python, NUMPY['3.14'])}"
            _run([interpreter, "-m", "venv", folder])
            _run([own, "-m", "pip", "install", "--quiet", "--no-deps", *wheels])
            _run([own, "-m", "pip", "install", "--quiet", "--only-binary=:all:", numpy])
            _run([own, "-I", ROOT / "tools" / "machine_code.py", partial])
        partial.replace(kept)
    return kept.read_bytes()


def _interpreter(python: str) -> str | None:
    """Return a Python of this version on this machine; None if there is none."""
    if sys.version_info[:2] == tuple(int(part) for part in python.split(".")):
        return sys.executable
    found = shutil.which(f"python{python}")
    if found is None or subprocess.run([found, "-c", "import venv, ensurepip"], capture_output=True).returncode != 0:
        return None
    return found


def _run(command: list[Path | str]) -> None:
    run = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if run.returncode != 0:
        raise BuildError(f"The solver's machine code could not be made ('{command[-1]}'):\n{run.stderr.strip()}")


def check_complete(wheels: list[Path], platform_name: str, python: str) -> None:
    """Raise unless all that the wheels require is among them, or numpy, in a version that fits."""
    versions = {"numpy": NUMPY.get(python, NUMPY["3.14"])}
    for wheel in wheels:
        name, version, _, _ = parse_wheel_filename(wheel.name)
        versions[name] = str(version)
    markers = {
        **MARKERS[platform_name],
        "python_version": python,
        "python_full_version": f"{python}.0",
        "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
        "extra": "",
    }
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            metadata = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
            headers = email.message_from_bytes(archive.read(metadata))
        for line in headers.get_all("Requires-Dist", []):
            requirement = Requirement(line)
            if requirement.marker is not None and not requirement.marker.evaluate(markers):
                continue
            version = versions.get(canonicalize_name(requirement.name))
            if version is None or not requirement.specifier.contains(version, prereleases=True):
                raise BuildError(
                    f"{wheel.name} requires {line}, but the zip for {platform_name} and Python {python} has "
                    f"{version or 'none'}; set it in {WHEEL_LIST.relative_to(ROOT)}."
                )


def manifest_for(
    platform_name: str, wheels: list[Path], blender_range: tuple[str, str | None], upload: dict[str, str]
) -> bytes:
    """Manifest of one zip: the repository's, with what holds for this zip only."""
    blender_min, blender_max = blender_range
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    tables = {key: manifest.pop(key) for key in list(manifest) if isinstance(manifest[key], dict)}
    manifest["blender_version_min"] = blender_min
    if blender_max is not None:
        manifest["blender_version_max"] = blender_max
    if upload:
        manifest["website"] = upload["website"]
        manifest["version"] += f"+{upload['python']}"
    manifest["platforms"] = [platform_name]
    manifest["wheels"] = [f"./wheels/{wheel.name}" for wheel in wheels]
    return tomli_w.dumps(manifest | tables).encode()


def blender_extension_tool() -> Path:
    """Blender's own command line for extensions, as bpy carries it."""
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        raise BuildError("Validating a zip needs Blender's own tool; run this where bpy is installed, as `make zip` does.")
    found = sorted(Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    if not found:
        raise BuildError(f"The bpy in {Path(spec.origin).parent} carries no extension tool; use bpy 4.2 or later.")
    return found[-1]


def validate(path: Path) -> None:
    """Let Blender's own tool read the zip, or the repository's folder."""
    command = [sys.executable, str(blender_extension_tool()), "validate", str(path)]
    run = subprocess.run(command, capture_output=True, text=True)
    if run.returncode != 0:
        raise BuildError(f"Blender's tool refuses {path.name}:\n{run.stdout.strip()}\n{run.stderr.strip()}")


def build(
    platform_name: str,
    python: str,
    out: Path,
    *,
    blender_range: tuple[str, str | None] | None = None,
    suffix: str = "",
    with_machine_code: bool = True,
    website: str = "",
) -> Path:
    """Build and validate one zip.

    Parameters
    ----------
    platform_name : str
        One of PLATFORMS.
    python : str
        Version of the Python that the target's Blender runs on, as in "3.11".
    out : Path
        Folder for the zip; made if it does not exist.
    blender_range : (str, str or None), optional
        First Blender it fits and first it no longer fits; by default the official ones with that Python.
    suffix : str
        Added to the file's name.
    with_machine_code : bool
        Whether the zip carries the kernels' machine code, where it can be made here (:func:`machine_code`).
    website : str
        Address of documentation, source and support: the zip is for extensions.blender.org. The platform wants it in the
        manifest, source that can be reviewed, so no machine code, and for each platform one zip per version, so that the
        version names the Python, as in 0.2.0+cp313.

    Returns
    -------
    Path
        The zip.

    Raises
    ------
    BuildError
        If a wheel cannot be had or Blender's tool refuses the zip.
    """
    if blender_range is None:
        if python not in BLENDER_RANGE:
            raise BuildError(f"No Blender ships Python {python}; for a distribution's, use --local with --blender-min.")
        blender_range = BLENDER_RANGE[python]
    wheels = wheels_for(platform_name, python)
    check_complete(wheels, platform_name, python)
    entries = {f"wheels/{wheel.name}": wheel.read_bytes() for wheel in wheels}
    entries |= {file.as_posix(): (ROOT / file).read_bytes() for file in package_files()}
    short = f"cp{python.replace('.', '')}"
    code = machine_code(platform_name, python, wheels) if with_machine_code and not website else None
    if code is not None:
        entries[MACHINE_CODE] = code
    entries["blender_manifest.toml"] = manifest_for(
        platform_name, wheels, blender_range, {"website": website, "python": short} if website else {}
    )

    version = tomllib.loads(entries["blender_manifest.toml"].decode())["version"]
    out.mkdir(parents=True, exist_ok=True)
    target = out / f"palpate-{version}-{platform_name}-{short}{suffix}.zip"
    partial = target.with_suffix(".partial.zip")
    write_zip(partial, entries)
    try:
        validate(partial)
    except BuildError:
        partial.unlink()
        raise
    return partial.replace(target)


def description(path: Path) -> str:
    """Return a line on a zip: its size, and whether the solver has to be compiled at first use."""
    with zipfile.ZipFile(path) as archive:
        carries = MACHINE_CODE in archive.namelist()
    code = "with machine code" if carries else "without machine code: the solver is compiled at first use, in half a minute"
    return f"{path}  {path.stat().st_size / 1e6:.0f} MB, {code}"


def write_zip(path: Path, entries: Mapping[str, bytes]) -> None:
    """Write files, by their names, so that the same files give the same bytes."""
    with zipfile.ZipFile(path, "w") as archive:
        for name in sorted(entries):
            info = zipfile.ZipInfo(name, FIXED_TIME)
            info.external_attr = 0o644 << 16
            info.create_system = 3  # Unix, wherever it is built
            # wheels and machine code are compressed already
            info.compress_type = zipfile.ZIP_STORED if name.endswith((".whl", ".bin")) else zipfile.ZIP_DEFLATED
            archive.writestr(info, entries[name])


def local_platform() -> str:
    """Blender's name of the platform this runs on."""
    found = _platform_here()
    if found is None:
        raise BuildError(f"There are no wheels for {platform.system()} {platform.machine()}; name a target with --platform.")
    return found


def _platform_here() -> str | None:
    here = {"sys_platform": sys.platform, "platform_machine": platform.machine()}
    return next((name for name, markers in MARKERS.items() if here.items() <= markers.items()), None)


def main(argv: list[str] | None = None) -> int:
    """Build the zips named on the command line."""
    parser = argparse.ArgumentParser(description="Build the Palpate extension zips.")
    add = parser.add_argument
    add(
        "--platform",
        choices=sorted(PLATFORMS),
        help="one platform only (default: all; with --local this one)",
    )
    add("--python-version", metavar="X.Y", help=f"one Python only (default: {' and '.join(BLENDER_RANGE)})")
    add("--local", action="store_true", help="for a distribution's Blender, whatever its Python")
    add("--blender-min", default="4.2.0", metavar="X.Y.Z", help="with --local: first Blender it fits")
    add("--no-machine-code", action="store_true", help="let the solver be compiled at first use, which takes half a minute")
    add("--website", default="", metavar="URL", help="address of documentation and support: for extensions.blender.org")
    add("--out", type=Path, metavar="DIR", help="folder for the zips (default: dist/, with --website dist/upload/)")
    args = parser.parse_args(argv)
    if args.local and not args.python_version:
        parser.error("--local needs --python-version: the Python that the distribution's Blender runs on")
    pythons = [args.python_version] if args.python_version else list(BLENDER_RANGE)
    blender_range = (args.blender_min, None) if args.local else None
    out = args.out or ROOT / "dist" / ("upload" if args.website else "")
    made = {"blender_range": blender_range, "suffix": "-local" if args.local else "", "website": args.website}
    try:
        platforms = [local_platform()] if args.local else list(PLATFORMS)
        for name in [args.platform] if args.platform else platforms:
            for python in pythons:
                path = build(name, python, out, with_machine_code=not args.no_machine_code, **made)
                print(description(path), flush=True)
    except BuildError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
