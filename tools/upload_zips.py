# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the zips for extensions.blender.org from those that tools/build_zip.py made.

    python tools/upload_zips.py --website https://… dist/*.zip      # into dist/upload/

The platform wants a website in the manifest, source that can be reviewed and, for each platform, one zip per version. Machine
code is therefore left out, and the version names the Python, as in 0.2.0+cp313. The zips are checked by
tools/extension_rules.py. Those for a distribution's Blender (``-local``) are not for the platform.
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
import zipfile
from pathlib import Path

import build_zip
import extension_rules
import tomli_w


def make(source: Path, website: str, folder: Path) -> Path:
    """Write the zip to upload.

    Parameters
    ----------
    source : Path
        A zip of tools/build_zip.py.
    website : str
        Address that the platform shows: documentation, source and where to report problems.
    folder : Path
        Folder for the zip; made if it does not exist.

    Returns
    -------
    Path
        The zip; the same source and website give the same bytes.

    Raises
    ------
    build_zip.BuildError
        If Blender's tool refuses the zip.
    """
    python = re.search(r"-(cp\d+)", source.stem)
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / source.name
    partial = target.with_suffix(".partial.zip")
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(partial, "w") as out:
        for info in archive.infolist():
            content = archive.read(info)
            if info.filename == build_zip.MACHINE_CODE:
                continue
            if info.filename == "blender_manifest.toml":
                manifest = tomllib.loads(content.decode())
                tables = {key: manifest.pop(key) for key in list(manifest) if isinstance(manifest[key], dict)}
                manifest["website"] = website
                if python is not None:
                    manifest["version"] += f"+{python[1]}"
                content = tomli_w.dumps(manifest | tables).encode()
            out.writestr(info, content)
    try:
        build_zip.validate(partial)
    except build_zip.BuildError:
        partial.unlink()
        raise
    return partial.replace(target)


def main(argv: list[str] | None = None) -> int:
    """Make and check the zips to upload."""
    parser = argparse.ArgumentParser(description="Make the zips for extensions.blender.org.")
    parser.add_argument("zips", nargs="+", type=Path, metavar="ZIP")
    parser.add_argument("--website", required=True, metavar="URL", help="address of documentation, source and support")
    parser.add_argument(
        "--out", type=Path, default=build_zip.ROOT / "dist" / "upload", metavar="DIR", help="folder for the zips"
    )
    args = parser.parse_args(argv)
    try:
        made = [make(path, args.website, args.out) for path in args.zips if not path.stem.endswith("-local")]
    except build_zip.BuildError as error:
        print(error, file=sys.stderr)
        return 1
    return extension_rules.main(["--upload", *map(str, made)])


if __name__ == "__main__":
    sys.exit(main())
