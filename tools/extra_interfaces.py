"""Build the Python interfaces of other people's ROS packages into .venv, as ours are built.

    python tools/extra_interfaces.py --from FOLDER [PACKAGE ...]

FOLDER holds their sources, in any depth: clones of the repositories in the branches of the ROS of
.venv. PACKAGE: names of packages; without one, those that the nodes can use (see EXTRAS) as far as
they are there, with what they need. What is built is a package of the interfaces alone, for Python
alone, in the version of the sources. Nothing of the sources is kept.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

from _distributions import ROOT

OURS = ROOT / "ros_ws" / "src" / "ir_msgs"
KINDS = ("msg", "srv", "action")
EXTRAS = ("control_msgs", "tf2_msgs", "moveit_msgs")
NEEDS_TAGS = ("depend", "build_depend")
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input", "-q")


class ExtraError(Exception):
    """What can't be built, in a sentence that says what to do."""


@dataclass(frozen=True)
class Source:
    """A package of interfaces: its folder, its version, the packages that it names as needed."""

    name: str
    folder: Path
    version: str
    needs: tuple[str, ...]


def sources(folder: Path) -> dict[str, Source]:
    """Packages of interfaces below a folder, by name; a name that is there twice is refused."""
    found: dict[str, Source] = {}
    for manifest in sorted(folder.rglob("package.xml")):
        source = read(manifest)
        if source is None:
            continue
        if source.name in found:
            other = found[source.name].folder
            raise ExtraError(f"{source.name} is there twice: {other} and {source.folder}. Keep one")
        found[source.name] = source
    return found


def read(manifest: Path) -> Source | None:
    """A package from its package.xml; None where it has no interfaces or isn't one of ROS 2."""
    try:
        root = Xml.parse(manifest).getroot()
    except Xml.ParseError as error:
        raise ExtraError(f"{manifest} can't be read: {error}") from error
    name = (root.findtext("name") or "").strip()
    version = (root.findtext("version") or "").strip()
    tools = {(each.text or "").strip() for each in root.iter("buildtool_depend")}
    tools |= {(each.text or "").strip() for each in root.iter("build_depend")}
    if "rosidl_default_generators" not in tools:
        return None
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or not re.fullmatch(r"\d+(\.\d+)*", version):
        raise ExtraError(f"{manifest} names {name!r} in version {version!r}: not those of ROS")
    needs = {(each.text or "").strip() for tag in NEEDS_TAGS for each in root.iter(tag)}
    return Source(name, manifest.parent, version, tuple(sorted(needs)))


def there(name: str) -> bool:
    """Whether .venv has the interfaces of this package."""
    return (Path(sys.prefix) / "share" / name / "package.xml").is_file()


def order(wanted: list[str], found: dict[str, Source]) -> list[Source]:
    """The wanted packages, each after those that it needs and .venv lacks."""
    placed: dict[str, Source] = {}

    def place(name: str, by: str, chain: tuple[str, ...]) -> None:
        if name in placed:
            return
        if name in chain:
            raise ExtraError(f"{' needs '.join([*chain, name])}: a circle")
        if name not in found:
            raise ExtraError(f"{name} {by} and is not below the folder: clone its repository there")
        for other in found[name].needs:
            if other.endswith(("_msgs", "_interfaces")) and not there(other):
                place(other, f"is needed by {name}", (*chain, name))
        placed[name] = found[name]

    for name in wanted:
        place(name, "was asked for", ())
    return list(placed.values())


def project(source: Source, folder: Path) -> Path:
    """Lay out one package as ours is laid out: its interfaces with our build around them."""
    made = folder / source.name
    made.mkdir()
    for kind in KINDS:
        if (source.folder / kind).is_dir():
            shutil.copytree(source.folder / kind, made / kind)
    shutil.copy(source.folder / "package.xml", made)
    shutil.copytree(OURS / "pip", made / "pip", ignore=shutil.ignore_patterns("__pycache__"))
    needed = " ".join(name for name in source.needs if there(name) and interfaces(name))
    cmake = substituted(
        (OURS / "CMakeLists.txt").read_text(),
        {
            r"project\(ir_msgs\)": f"project({source.name})",
            r"set\(interface_packages [^)]*\)": f"set(interface_packages {needed})",
        },
    )
    (made / "CMakeLists.txt").write_text(cmake)
    build = substituted(
        (OURS / "pyproject.toml").read_text(),
        {
            r'(?m)^name = "ir-msgs"': f'name = "{source.name.replace("_", "-")}"',
            r'(?m)^version = ".*"': f'version = "{source.version}"',
            r'(?m)^description = ".*"': f'description = "Interfaces of {source.name}"',
            r"(?m)^license = .*\n": "",
            r"(?m)^dependencies = .*\n": "",
        },
    )
    (made / "pyproject.toml").write_text(build)
    return made


def interfaces(name: str) -> bool:
    """Whether an installed package has interfaces that others can be made of."""
    index = Path(sys.prefix) / "share" / "ament_index" / "resource_index" / "rosidl_interfaces"
    return (index / name).is_file()


def substituted(text: str, changes: dict[str, str]) -> str:
    """The text with each pattern replaced, which must be there once."""
    for pattern, new in changes.items():
        text, count = re.subn(pattern, new.replace("\\", r"\\"), text)
        if count != 1:
            raise ExtraError(f"{OURS} is not as this tool knows it: {count} times {pattern}")
    return text


def build(source: Source) -> None:
    """Build one package and install it; what was there of it is replaced."""
    with tempfile.TemporaryDirectory() as folder:
        made = project(source, Path(folder))
        command = (*PIP, "install", "--no-deps", "--no-build-isolation", "--use-pep517")
        done = subprocess.run([*command, "--force-reinstall", str(made)], check=False)
        if done.returncode:
            raise ExtraError(f"{source.name} {source.version} was not built: see above")


def main() -> int:
    """Build what was asked for, in the order in which it is needed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--from", dest="folder", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("packages", nargs="*", metavar="PACKAGE")
    arguments = parser.parse_args()
    try:
        found = sources(arguments.folder)
        wanted = arguments.packages or [name for name in EXTRAS if name in found]
        if not wanted:
            raise ExtraError(f"none of {', '.join(EXTRAS)} is below {arguments.folder}")
        for source in order(wanted, found):
            print(f"{source.name} {source.version}", flush=True)
            build(source)
    except ExtraError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
