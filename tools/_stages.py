"""The steps of set-up: what each depends on, what it leaves behind, and its commands."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from _distributions import (
    CONSTRAINTS,
    ROOT,
    STAMPS,
    VENV,
    missing_editable,
    missing_wheels,
    site_packages,
    wanted,
)

PYTHON = VENV / "bin" / "python"
LOGS = ROOT / "out" / "setup"
INTERFACES = ROOT / "ros_ws" / "src" / "ir_msgs"
KERNELS = ROOT / "src" / "ir_kernels"
TOOLS, BUILD, RUN, TESTS = (
    ROOT / "requirements" / f"{name}.txt" for name in ("tools", "build", "run", "dev")
)
LOCAL = ("--no-deps", "--no-build-isolation", "--use-pep517")
WHEELS = ROOT / "out" / "setup" / "wheels"
PIP = ("-m", "pip", "--disable-pip-version-check", "--no-input")


@dataclass(frozen=True)
class Stage:
    """One step: what it says, what it depends on, what of its result is missing, and the commands.

    after: names of the steps whose results it needs. Builds run side by side with everything, and
    yield to installs; these run one after another, for they write into one environment.
    """

    name: str
    says: str
    fingerprint: str
    missing: Callable[[], list[str]]
    after: tuple[str, ...] = ()
    builds: tuple[str, ...] = ()
    installs: tuple[str, ...] = ()
    requirements: Path | None = None
    folder: Path = ROOT
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def stamp(self) -> Path:
        """The file that holds the fingerprint of what is there."""
        return STAMPS / self.name

    @property
    def log(self) -> Path:
        """The file that takes the output of its commands."""
        return LOGS / f"{self.name}.log"


def fingerprint(files: Iterable[Path], *words: str) -> str:
    """Hash of names and contents, so that neither a checkout nor a touch rebuilds anything."""
    digest = hashlib.sha256("\0".join(words).encode())
    for file in sorted(files):
        digest.update(f"\0{file.relative_to(ROOT)}\0".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def packages() -> list[Path]:
    """Return the Python packages of src/ other than the compiled core."""
    return sorted(
        setup.parent for setup in (ROOT / "src").glob("*/setup.py") if setup.parent != KERNELS
    )


def interface_files() -> list[Path]:
    """Return what the messages, services and actions are made from."""
    return [p for p in INTERFACES.rglob("*") if p.is_file() and "__pycache__" not in p.parts]


def kernel_files() -> list[Path]:
    """Return what the compiled core is made from."""
    return [
        file for pattern in ("cpp/*", "*.py", "*.toml", "*.cfg") for file in KERNELS.glob(pattern)
    ]


def metadata_files() -> list[Path]:
    """Return what describes the Python packages."""
    return [
        f for p in packages() for f in p.iterdir() if f.suffix in (".py", ".cfg", ".toml", ".xml")
    ]


class Stages:
    """The steps, each after those that it needs."""

    def __init__(self, python_version: str) -> None:
        self.version = python_version
        self.site = site_packages(python_version)
        self.pip = (str(PYTHON), *PIP)

    def all(self, tests: bool, portable: bool) -> list[Stage]:
        """Return the steps; with those for tests, or with the core for any x86-64 alone."""
        stages = [
            self.wheels(TOOLS, "tools that compile"),
            self.wheels(BUILD, "ROS 2 Jazzy and what builds on it (300 MB)", TOOLS),
            self.core("native", "this processor"),
            self.interfaces(),
            self.wheels(RUN, "wheels of the nodes", BUILD),
            self.editable(),
        ]
        if tests:
            stages.append(self.wheels(TESTS, "wheels of tests and checks", RUN))
        if tests or portable:  # tests compare both builds
            stages.append(self.core("baseline", "any x86-64"))
        return stages

    def wheels(self, requirements: Path, says: str, after: Path | None = None) -> Stage:
        """Return the stage that installs a file of requirements.

        Those of tests are compiled to bytecode when they are imported: most of it never is.
        """
        source = ""
        if requirements == RUN and self.version != "3.11" and "pybullet" in wanted(RUN):
            source = f"; on {self.version} PyBullet is built from source, 3 minutes more"
        lazily = ("--no-compile",) if requirements == TESTS else ()
        return Stage(
            requirements.stem,
            f"{says}{source}",
            fingerprint([CONSTRAINTS, requirements], self.version),
            lambda: missing_wheels(self.site, requirements),
            after=() if after is None else (after.stem,),
            installs=(*self.pip, "install", *lazily, "-r", str(requirements)),
            requirements=requirements,
        )

    def interfaces(self) -> Stage:
        """Return the stage that generates and builds ir_msgs."""
        pinned = CONSTRAINTS.read_text().splitlines()
        built_with = [p for p in pinned if p.startswith(("ros-", "numpy", "scikit-build"))]
        return Stage(
            "interfaces",
            "messages, services and actions for Python",
            fingerprint(interface_files(), self.version, *built_with),
            lambda: [] if (self.site / "ir_msgs").is_dir() else ["ir_msgs"],
            after=(BUILD.stem,),
            builds=(*self.pip, "wheel", *LOCAL, "--wheel-dir", str(WHEELS), str(INTERFACES)),
            installs=(
                *self.pip,
                "install",
                *LOCAL,
                "--force-reinstall",
                "--no-index",
                "--find-links",
                str(WHEELS),
                "ir-msgs",
            ),
        )

    def core(self, variant: str, runs_on: str) -> Stage:
        """Return the stage that builds a variant of the compiled core where it is imported from."""
        return Stage(
            f"core_{variant}",
            f"compiled core for {runs_on}",
            fingerprint(kernel_files(), self.version),
            lambda: (
                [] if any((KERNELS / "ir_kernels").glob(f"_{variant}*.so")) else [f"_{variant}*.so"]
            ),
            after=(TOOLS.stem,),
            builds=(str(PYTHON), "setup.py", "-q", "build_ext", "--inplace"),
            folder=KERNELS,
            environment={"IR_KERNELS_VARIANTS": variant},
        )

    def editable(self) -> Stage:
        """Return the stage that installs the packages of src/ from where they lie."""
        folders = [KERNELS, *packages()]
        words = tuple(word for folder in folders for word in ("--editable", str(folder)))
        return Stage(
            "packages",
            "the Python packages, editable",
            fingerprint(metadata_files(), self.version),
            lambda: missing_editable(self.site, folders),
            after=(RUN.stem,),  # ROS first: the interfaces wait for it
            installs=(*self.pip, "install", *LOCAL, *words),
            environment={"IR_KERNELS_VARIANTS": ""},  # built already
        )
