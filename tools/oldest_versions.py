"""Set up a copy of the sources with other versions than the usual ones, and run the tests there.

    python tools/oldest_versions.py [what pytest takes]
    python tools/oldest_versions.py --newest --python 3.12 --python 3.13 [what pytest takes]

The first has the oldest supported versions, `[oldest]` in requirements/supported.toml; the second
has those of requirements/constraints.txt on other Pythons. The copy lies in out/oldest or
out/newest, one for each Python, and its set-up is the usual one: PyBullet is built from source
where it has no wheel. Only what has changed is copied and built again. The tests run on the
portable variant of the compiled core: no other run tests it as a whole.

Left out, by name: what has no wheel with the oldest versions (LEFT_OUT), and PyBullet with what
needs it where it can't be built.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("msgs_py", "description", "kernels", "planner", "driver", "nodes", "runner", "faults")
LEFT_OUT = {
    "coal": "its wheels need NumPy 2",
    "pin": "its wheels need NumPy 2",
    "casadi": "only for benchmarks",
    "ompl": "an extra, tested once",
    "toppra": "only for benchmarks",
    "colcon-common-extensions": "builds with colcon are tested once",
    "ruff": "checks are made once",
    "mypy": "checks are made once",
    "types-PyYAML": "checks are made once",
    "scipy-stubs": "checks are made once",
}
OTHERWISE = {
    "tests/planner/test_path_timing.py::test_the_objective_counts_at_a_free_duration": (
        "descents of SciPy 1.11 end up to 2 % above the least cost"
    ),
}
"""Tests that ask for more than the oldest versions achieve, and what these achieve."""
PEERS = r"pinocchio|\bcoal\b|coal_scene|oracles|with_ompl"
"""Words of the test files that are left out with LEFT_OUT."""
PHYSICS = (
    r"pybullet"
    r"|sim_driver.node|SimDriver|program_runner|run_program"  # nodes that drive on physics
    r"|make_simulation\(cell\)|typical_plant"
)
"""Words of the test files that are left out without PyBullet."""
_ROS_OF_ANOTHER = (
    "_ROS_WHEELS_BOOTSTRAP_COMPLETE",
    "LD_LIBRARY_PATH",
    "PYTHONPATH",
    "AMENT_PREFIX_PATH",
)


def supported() -> dict[str, object]:
    """Return the table of supported versions."""
    return tomllib.loads((ROOT / "requirements" / "supported.toml").read_text(encoding="utf-8"))


def canonical(name: str) -> str:
    """Return the name of a distribution as all its spellings have it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def with_versions(constraints: str, versions: dict[str, str]) -> str:
    """Return a constraints file with other versions; names that it has no line for are added."""
    left = {canonical(name): f"{name}=={version}" for name, version in versions.items()}
    lines = [left.pop(canonical(line.split("==")[0]), line) for line in constraints.splitlines()]
    return "\n".join([*lines, *left.values(), ""])


def without(requirements: str, names: set[str]) -> str:
    """Return a requirements file without the lines of these names."""
    kept = [
        line
        for line in requirements.splitlines()
        if canonical(re.split(r"[\[=<>~!; ]", line)[0]) not in names
    ]
    return "\n".join([*kept, ""])


def copy_sources(copy: Path, changed: dict[str, str]) -> None:
    """Bring the copy up to date with the files that git knows; files of equal content keep their
    time.
    """
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True
    ).stdout
    names = [name for name in listed.decode().split("\0") if name and (ROOT / name).is_file()]
    for name in names:
        source = ROOT / name
        target = copy / name
        content = changed[name].encode() if name in changed else source.read_bytes()
        if not target.is_file() or target.read_bytes() != content:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
            target.chmod(source.stat().st_mode & 0o777)
    for folder in ("src", "tests", "ros_ws"):
        for path in (copy / folder).rglob("*.py"):
            if (
                not {"build", "__pycache__"} & set(path.parts)
                and not (ROOT / path.relative_to(copy)).exists()
            ):
                path.unlink()


def requirements(versions: dict[str, str], left_out: set[str]) -> dict[str, str]:
    """Return the changed files of requirements/ by their paths."""
    folder = ROOT / "requirements"
    names = {canonical(name) for name in left_out}
    files = {
        f"requirements/{name}.txt": without(
            (folder / f"{name}.txt").read_text(encoding="utf-8"), names
        )
        for name in ("tools", "build", "run", "dev")
    }
    constraints = (folder / "constraints.txt").read_text(encoding="utf-8")
    return {**files, "requirements/constraints.txt": with_versions(constraints, versions)}


def tests(copy: Path, needs: str) -> list[str]:
    """Return the test files of FOLDERS that have none of the words `needs`."""
    files = [
        path for folder in FOLDERS for path in sorted((copy / "tests" / folder).glob("test_*.py"))
    ]
    absent = re.compile(needs or r"(?!)")
    kept = [path for path in files if not absent.search(path.read_text(encoding="utf-8"))]
    if len(kept) < len(files):
        left = ", ".join(path.name for path in files if path not in kept)
        print("left out:", left, flush=True)
    return [str(path.relative_to(copy)) for path in kept]


def set_up(copy: Path, python: str, files: dict[str, str], environment: dict[str, str]) -> int:
    """Set the copy up with these files of requirements/; the exit code of the step that failed."""
    copy.mkdir(parents=True, exist_ok=True)
    (ROOT / "out" / "COLCON_IGNORE").touch()
    copy_sources(copy, files)
    found = subprocess.run(
        ["/bin/sh", "tools/find_python.sh"],
        cwd=copy,
        env={**environment, "PYTHON": f"python{python}"},
        stdout=subprocess.PIPE,
        text=True,
    )
    if found.returncode:
        return found.returncode
    command = [found.stdout.strip(), "tools/set_up.py", "--tests", "--portable"]
    return subprocess.run(command, cwd=copy, env=environment).returncode


def run(python: str, versions: dict[str, str] | None, pytest: list[str]) -> int:
    """Set up and test with one Python; versions: None for those of constraints.txt.

    The exit code of the step that failed.
    """
    name = "newest" if versions is None else "oldest"
    copy = ROOT / "out" / name / python
    environment = {name: value for name, value in os.environ.items() if name not in _ROS_OF_ANOTHER}
    left_out = set() if versions is None else set(LEFT_OUT)
    needs = "" if versions is None else PEERS
    print(f"== Python {python} with the {name} versions", flush=True)
    if left_out:
        print("not installed:", ", ".join(sorted(left_out)), flush=True)
    code = set_up(copy, python, requirements(versions or {}, left_out), environment)
    if code:
        print("once more without PyBullet, with what needs it left out", flush=True)
        files = requirements(versions or {}, left_out | {"pybullet"})
        code = set_up(copy, python, files, environment)
        needs = "|".join(filter(None, (needs, PHYSICS)))
    if code:
        return code
    otherwise = () if versions is None else OTHERWISE
    chosen = [*pytest, *(word for test in otherwise for word in ("--deselect", test))]
    side_by_side = ["-n", str(os.cpu_count() or 2), "--dist", "worksteal"]
    command = [
        ".venv/bin/python", "-m", "pytest", *side_by_side, "-m", "not long",
        *tests(copy, needs), *chosen,
    ]  # fmt: skip
    return subprocess.run(
        command, cwd=copy, env={**environment, "IR_KERNELS": "baseline"}
    ).returncode


def main() -> int:
    """Set up and test with each Python; 1 where any of them failed."""
    table = supported()
    oldest = dict(table["oldest"])  # type: ignore[call-overload]
    usual = oldest.pop("python")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", action="append", help=f"version, repeatable (default: {usual})")
    parser.add_argument(
        "--newest", action="store_true", help="with the versions of constraints.txt"
    )
    given, pytest = parser.parse_known_args()
    codes = {
        python: run(python, None if given.newest else oldest, pytest)
        for python in given.python or [usual]
    }
    for python, code in codes.items():
        print(f"Python {python}: {'green' if code == 0 else f'failed with {code}'}")
    return int(any(codes.values()))


if __name__ == "__main__":
    sys.exit(main())
