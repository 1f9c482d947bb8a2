# SPDX-License-Identifier: GPL-3.0-or-later
"""Check extension zips by the published rules of extensions.blender.org; docs/extension-platform.md lists rules and sources.

    python tools/extension_rules.py dist/*.zip                    # names what hinders an upload, fails on other faults
    python tools/extension_rules.py --upload dist/upload/*.zip    # fails on either

Blender's own tool, which tools/build_zip.py runs, judges the syntax of the manifest. This judges what the platform's reviewers
look for. A zip with machine code, or without `website`, is good for one's own site and not for the platform.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from packaging.utils import parse_wheel_filename

TAGS = set(
    """3D View,Add Curve,Add Mesh,Animation,Bake,Camera,Compositing,Development,Game Engine,Geometry Nodes,Grease Pencil,
Import-Export,Lighting,Material,Modeling,Mesh,Node,Object,Paint,Pipeline,Physics,Render,Rigging,Scene,Sculpt,Sequencer,System,
Text Editor,Tracking,User Interface,UV""".replace("\n", "").split(",")
)
LONGEST_TEXT = 64
"""Characters of the tagline and of a permission's reason."""
SHIPPED = {"numpy", "requests", "certifi", "charset-normalizer", "idna", "urllib3", "zstandard"}
"""Packages that Blender brings; a wheel of them would shadow Blender's own."""
COMPILED = {".pyc", ".pyo", ".so", ".pyd", ".dll", ".dylib", ".exe", ".bin", ".o", ".a"}
NETWORK = {"socket", "urllib", "http", "requests", "ftplib", "smtplib", "ssl", "socketserver", "xmlrpc", "webbrowser"}
PLATFORM_TAGS = {
    "linux-x64": r"manylinux.*_x86_64",
    "windows-x64": r"win_amd64",
    "macos-arm64": r"macosx_.*_(arm64|universal2)",
}

PROCESS, NETWORK_USE, SEARCH = "starts a process", "uses a network", "changes where all extensions search for modules"
EXCUSED = {
    (PROCESS, "addon/session/first_use.py"): "compiles the solver beside Blender, so that its window stays usable",
    (PROCESS, "addon/study/study_process.py"): "runs a study with the program that the user names in the preferences",
    (NETWORK_USE, "commands/console.py"): "a pair of sockets within the process, by which Ctrl-C wakes a thread",
    (SEARCH, "core/solver/precompile_process.py"): "is a process of its own, which searches where Blender does",
}
"""What a reviewer has to ask about: what a file does, and why it may. The page has the same list."""


@dataclass(frozen=True)
class Finding:
    """What is against a rule: where, a sentence, and whether it hinders an upload alone."""

    where: str
    sentence: str
    for_upload_only: bool = False


def check(path: Path) -> list[Finding]:
    """Return what is against the rules in a zip."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        try:
            manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        except (KeyError, ValueError) as error:
            return [Finding("blender_manifest.toml", f"cannot be read: {error}")]
        sources = {name: archive.read(name).decode() for name in names if name.endswith(".py")}
    return [*_manifest(manifest), *_wheels(manifest, names), *_files(names), *_sources(sources)]


def check_together(manifests: dict[str, dict[str, Any]]) -> list[Finding]:
    """Return what is against the rules in several zips together: a version may have one zip for each platform."""
    found: dict[tuple[str, str], str] = {}
    findings = []
    for name, manifest in manifests.items():
        for platform in manifest.get("platforms", []):
            other = found.setdefault((manifest["version"], platform), name)
            if other != name:
                sentence = f"has version {manifest['version']} for {platform}, as {other} has: give each a version of its own"
                findings.append(Finding(name, sentence, for_upload_only=True))
    return findings


def _manifest(manifest: dict[str, Any]) -> Iterator[Finding]:
    def finding(sentence: str, for_upload_only: bool = False) -> Finding:
        return Finding("blender_manifest.toml", sentence, for_upload_only)

    if "blender" in manifest["name"].lower():
        yield finding("the name contains 'Blender'")
    texts = {"tagline": manifest["tagline"]} | {f"permission {key}": text for key, text in manifest["permissions"].items()}
    for field, text in texts.items():
        if not 0 < len(text) <= LONGEST_TEXT:
            yield finding(f"{field} has {len(text)} characters, and may have {LONGEST_TEXT}")
        if not text[-1:].isalnum():
            yield finding(f"{field} ends with punctuation")
    if unknown := set(manifest.get("tags", [])) - TAGS:
        yield finding(f"the platform knows no tag {', '.join(sorted(unknown))}")
    if "files" not in manifest["permissions"]:
        yield finding("the permission 'files' is missing, and files are written")
    if "SPDX:GPL-3.0-or-later" not in manifest["license"]:
        yield finding("the licence of an add-on has to be GPL-3.0-or-later")
    if not all(re.fullmatch(r"\d{4}(-\d{4})? \S.*", line) for line in manifest.get("copyright", [])):
        yield finding("a copyright is a year or two, and a name")
    if tuple(map(int, manifest["blender_version_min"].split("."))) < (4, 2, 0):
        yield finding("extensions begin with Blender 4.2.0")
    if any(word in str(manifest) for word in ("Developer name", "my_example", "example.com", "example.org")):
        yield finding("a value of the template was left in")
    if not re.fullmatch(r"https://[^\s/]+\.[^\s/]+(/\S*)?", manifest.get("website", "")):
        yield finding("website is missing: build with 'make zip WEBSITE=https://…'", for_upload_only=True)


def _wheels(manifest: dict[str, Any], names: list[str]) -> Iterator[Finding]:
    platforms, listed = manifest.get("platforms", []), manifest.get("wheels", [])
    if len(platforms) != 1:
        yield Finding("blender_manifest.toml", f"one platform per zip, and not {len(platforms)}")
    if {f"./{name}" for name in names if name.startswith("wheels/")} != set(listed):
        yield Finding("blender_manifest.toml", "the wheels listed are not those in the zip")
    pythons = set()
    for wheel in listed:
        name, _, _, tags = parse_wheel_filename(PurePosixPath(wheel).name)
        if name in SHIPPED:
            yield Finding(wheel, "Blender ships this package itself")
        fits = [t for t in tags if t.platform == "any" or any(re.fullmatch(PLATFORM_TAGS[p], t.platform) for p in platforms)]
        if not fits:
            yield Finding(wheel, f"is not for {', '.join(platforms)}")
        pythons |= {t.interpreter for t in fits if t.platform != "any" and t.abi != "abi3"}
    if len(pythons) > 1:
        yield Finding(
            "wheels", f"are for several Pythons ({', '.join(sorted(pythons))}); Blender 4.2 does not choose among them"
        )


def _files(names: list[str]) -> Iterator[Finding]:
    if "LICENSE" not in names:
        yield Finding("LICENSE", "is missing")
    for name in names:
        path = PurePosixPath(name)
        if any(part.startswith(".") or part in ("__pycache__", "__MACOSX") for part in path.parts):
            yield Finding(name, "is redundant: leave it out")
        if path.suffix in COMPILED:
            sentence = "is no source: the code has to be reviewable; build with --no-machine-code"
            yield Finding(name, sentence, for_upload_only=True)


def _sources(sources: dict[str, str]) -> Iterator[Finding]:
    asked: dict[tuple[str, str], str] = {}
    for name, text in sources.items():
        for node in ast.walk(ast.parse(text, name)):
            where = f"{name}:{getattr(node, 'lineno', 0)}"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("eval", "exec", "compile"):
                yield Finding(where, f"{node.func.id}() runs code that nobody can review")
            for module in _imported(node):
                if module in ("palpate", "bl_ext"):
                    yield Finding(where, "imports the extension by an absolute name; Blender gives it another")
                if module == "pip":
                    yield Finding(where, "installs packages; what is needed comes as wheels")
                if module in NETWORK:
                    asked.setdefault((NETWORK_USE, name), where)
            if _starts_process(node):
                asked.setdefault((PROCESS, name), where)
            if _changes_search(node):
                asked.setdefault((SEARCH, name), where)
    for what, name in sorted(set(asked) - set(EXCUSED)):
        yield Finding(asked[what, name], f"{what}: say in EXCUSED and on the page why it may")
    for what, name in sorted(set(EXCUSED) - set(asked)):
        if name in sources:
            yield Finding(name, f"is excused in tools/extension_rules.py, and no longer {what}")


def _starts_process(node: ast.AST) -> bool:
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute) or not isinstance(node.func.value, ast.Name):
        return False
    module, name = node.func.value.id, node.func.attr
    return module in ("subprocess", "multiprocessing") or (
        module == "os" and name.startswith(("exec", "spawn", "posix_spawn", "system", "popen"))
    )


def _imported(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name.partition(".")[0] for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.level == 0:
        return [(node.module or "").partition(".")[0]]
    return []


def _changes_search(node: ast.AST) -> bool:
    """Return True where a statement assigns to sys.path or calls a method of it that changes it."""
    if isinstance(node, (ast.Assign, ast.AugAssign)):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        return any(_is_sys_path(t.value if isinstance(t, ast.Subscript) else t) for t in targets)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        return _is_sys_path(node.func.value) and node.func.attr in ("append", "insert", "extend", "remove", "clear")
    return False


def _is_sys_path(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Attribute) and node.attr == "path" and isinstance(node.value, ast.Name) and node.value.id == "sys"
    )


def main(argv: list[str] | None = None) -> int:
    """Check the zips named on the command line."""
    parser = argparse.ArgumentParser(description="Check extension zips by the rules of extensions.blender.org.")
    parser.add_argument("zips", nargs="+", type=Path, metavar="ZIP")
    parser.add_argument("--upload", action="store_true", help="fail, too, on what is wrong for the platform alone")
    args = parser.parse_args(argv)
    manifests = {}
    findings: list[tuple[str, Finding]] = []
    for path in args.zips:
        with zipfile.ZipFile(path) as archive:
            manifests[path.name] = tomllib.loads(archive.read("blender_manifest.toml").decode())
        findings += [(path.name, finding) for finding in check(path)]
    findings += [("", finding) for finding in check_together(manifests)]
    wrong = 0
    for name, finding in findings:
        counts = args.upload or not finding.for_upload_only
        wrong += counts
        print(
            f"{'wrong' if counts else 'not for the platform'}: {name}{': ' if name else ''}{finding.where}: {finding.sentence}"
        )
    own_only = len(findings) - wrong
    print(
        f"{len(args.zips)} zips: {wrong} findings against the rules"
        + (f"; {own_only} that matter only for extensions.blender.org, so keep these zips to your own site" if own_only else "")
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
