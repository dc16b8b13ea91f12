"""`colcon build` in ros_ws builds the sources that pip builds: colcon and ROS 2 come from the
environment.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
WORKSPACE = ROOT / "ros_ws"
NODES = ("ir_planner", "ir_sim_driver", "ir_program_runner", "ir_recorder")


def colcon(*arguments: str, log_base: Path, core: str = "") -> subprocess.CompletedProcess[str]:
    """Run colcon in ros_ws as on a machine where this environment is the sourced ROS 2.

    core: the build of the core to compile; "" = none, as set-up has compiled by the same setup.py.
    """
    bin_folder = Path(sys.executable).parent
    environment = {
        **os.environ,
        "PATH": f"{bin_folder}{os.pathsep}{os.environ.get('PATH', os.defpath)}",
        "AMENT_PREFIX_PATH": sys.prefix,
        "CMAKE_PREFIX_PATH": sys.prefix,
        "IR_KERNELS_VARIANTS": core,
        "MAKEFLAGS": "-j2",
    }
    for inherited in ("MAKELEVEL", "MFLAGS", "PYTHONPATH"):
        environment.pop(inherited, None)
    command = [str(bin_folder / "colcon"), "--log-base", str(log_base), *arguments]
    return subprocess.run(command, cwd=WORKSPACE, env=environment, capture_output=True, text=True)


def build(folder: Path, *selection: str, core: str = "") -> Path:
    """Build into a folder outside of the sources; return the install prefix."""
    done = colcon(
        "build",
        *(
            "--build-base",
            str(folder / "build"),
            "--install-base",
            str(folder / "install"),
            "--merge-install",
        ),
        *selection,
        *("--cmake-args", "-DCMAKE_PROJECT_INCLUDE=pip/venv_prefix.cmake", "-DBUILD_TESTING=OFF"),
        f"-DPython3_EXECUTABLE={sys.executable}",
        log_base=folder / "log",
        core=core,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return folder / "install"


def site_of(prefix: Path) -> Path:
    """The folder of Python packages below an install prefix."""
    return next((prefix / "lib").glob("python3.*/site-packages"))


def test_colcon_finds_both_source_trees_and_nothing_else(tmp_path: Path) -> None:
    listed = colcon("list", "--names-only", log_base=tmp_path)
    python = {setup.parent.name for setup in (ROOT / "src").glob("*/setup.py")}
    assert set(listed.stdout.split()) == python | {"ir_msgs", "ir_bringup"}, listed.stderr


@pytest.mark.long
def test_colcon_builds_the_python_packages(tmp_path: Path) -> None:
    prefix = build(tmp_path, "--packages-ignore", "ir_msgs")
    for node in NODES:
        assert os.access(prefix / "lib" / node / node, os.X_OK), (
            f"ros2 run {node} {node} has nothing to run"
        )
        assert (prefix / "share" / "ament_index" / "resource_index" / "packages" / node).is_file()
    assert (prefix / "share" / "ir_bringup" / "launch" / "cell.launch.py").is_file()

    site = site_of(prefix)
    program = "import ir_description; print(ir_description.__file__); ir_description.load_robot()"
    ran = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(site)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert ran.stdout.startswith(str(site)), ran.stdout + ran.stderr
    assert ran.returncode == 0, ran.stderr
    assert list(site.glob("ir_msgs_py/ros/*.xml")), "the discovery profile is not installed"


@pytest.mark.long
def test_colcon_builds_the_interfaces_and_the_core_which_passes_its_tests(tmp_path: Path) -> None:
    """It is compared with the reference and with the build for this processor."""
    prefix = build(tmp_path, "--packages-up-to", "ir_kernels", core="baseline")
    declared = {file.name for file in (WORKSPACE / "src" / "ir_msgs").glob("*/*.msg")}
    assert {file.name for file in (prefix / "share" / "ir_msgs" / "msg").glob("*.msg")} == declared
    assert list((prefix / "lib").glob("python3.*/site-packages/ir_msgs/ir_msgs_s__*.so"))

    site = site_of(prefix)
    assert list(site.glob("ir_kernels/_baseline*.so")), "the core was not compiled"
    for built in (ROOT / "src" / "ir_kernels" / "ir_kernels").glob("_[np]*.so"):
        (site / "ir_kernels" / built.name).symlink_to(built)
    environment = {**os.environ, "PYTHONPATH": str(site)}
    pytest_here = (sys.executable, "-m", "pytest", "-n0", "-q", "-rs", "-m", "not long")
    command = (*pytest_here, "-k", "baseline", "tests/kernels")
    tested = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True)
    assert tested.returncode == 0, tested.stdout[-4000:] + tested.stderr[-1000:]
    assert "skipped" not in tested.stdout, tested.stdout[-2000:]
