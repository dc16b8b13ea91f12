"""Set-up: an interpreter that really runs, sentences that say what to install, work only for what
changed.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
FIND_PYTHON = ROOT / "tools" / "find_python.sh"
SHIM = "#!/bin/sh\necho 'command not found in this version manager' >&2\nexit 127\n"


@pytest.fixture(scope="module")
def set_up() -> ModuleType:
    sys.path.append(str(ROOT / "tools"))  # as it is when the script runs
    return importlib.import_module("set_up")


@pytest.fixture(scope="module")
def distributions(set_up: ModuleType) -> ModuleType:
    return importlib.import_module("_distributions")


@pytest.fixture(scope="module")
def stages(set_up: ModuleType) -> ModuleType:
    return importlib.import_module("_stages")


def executable(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)
    return path


def find_python(cwd: Path, path: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["/bin/sh", str(FIND_PYTHON)],
        cwd=cwd,
        env={"PATH": path, **variables},
        capture_output=True,
        text=True,
    )


def complete_python(folder: Path, name: str) -> Path:
    """A stand-in for an interpreter with everything: it answers that nothing is missing."""
    return executable(folder / name, "#!/bin/sh\nexit 0\n")


def test_a_shim_that_fails_is_passed_over(tmp_path: Path) -> None:
    executable(tmp_path / "shims" / "python3.11", SHIM)
    good = complete_python(tmp_path / "bin", "python3.12")
    found = find_python(tmp_path, f"{tmp_path}/shims:{tmp_path}/bin")
    assert found.stdout.strip() == str(good), found.stderr


def test_the_interpreter_beside_a_shim_that_fails_is_found(tmp_path: Path) -> None:
    executable(tmp_path / "shims" / "python3.12", SHIM)
    good = complete_python(tmp_path / "versions" / "3.12.1" / "bin", "python3.12")
    assert find_python(tmp_path, f"{tmp_path}/shims").stdout.strip() == str(good)


def test_python_3_11_comes_first(tmp_path: Path) -> None:
    for name in ("python3.13", "python3.12", "python3.11"):
        complete_python(tmp_path / "bin", name)
    assert find_python(tmp_path, f"{tmp_path}/bin").stdout.strip().endswith("/python3.11")


def test_without_an_interpreter_a_sentence_says_what_to_install_and_what_was_seen(
    tmp_path: Path,
) -> None:
    shim = executable(tmp_path / "shims" / "python3.11", SHIM)
    for tool in ("head", "cat"):
        (tmp_path / "shims" / tool).symlink_to(f"/usr/bin/{tool}")
    found = find_python(tmp_path, f"{tmp_path}/shims")
    assert found.returncode == 1
    assert "apt install python3.11 python3.11-venv" in found.stderr
    assert f"{shim}: command not found in this version manager" in found.stderr


def test_an_interpreter_may_be_named(tmp_path: Path) -> None:
    mine = complete_python(tmp_path / "mine", "python")
    assert find_python(tmp_path, "/usr/bin:/bin", PYTHON=str(mine)).stdout.strip() == str(mine)


def test_an_unfit_interpreter_says_why(tmp_path: Path) -> None:
    old = executable(
        tmp_path / "old",
        f'#!/bin/sh\nexec "{sys.executable}" -c "import sys; sys.exit(\'is Python 3.8\')"\n',
    )
    found = find_python(tmp_path, "/usr/bin:/bin", PYTHON=str(old))
    assert found.returncode == 1
    assert f"{old}: is Python 3.8" in found.stderr


def test_the_environment_that_is_there_is_taken(tmp_path: Path) -> None:
    executable(tmp_path / ".venv" / "bin" / "python", "#!/bin/sh\nexit 0\n")
    assert find_python(tmp_path, "/usr/bin:/bin").stdout.strip() == ".venv/bin/python"


def test_a_missing_compiler_is_named_with_its_package(
    set_up: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(set_up.SetupError, match=r"No g\+\+ .*apt install g\+\+"):
        set_up.check_machine()


def test_another_machine_is_sent_to_the_container(
    set_up: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(set_up.platform, "machine", lambda: "aarch64")
    with pytest.raises(set_up.SetupError, match=r"x86-64 Linux; this is aarch64 .*docker/"):
        set_up.check_machine()


def test_only_names_and_contents_make_the_fingerprint(
    stages: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stages, "ROOT", tmp_path)
    file = tmp_path / "Status.msg"
    file.write_text("int32 code\n")
    before = stages.fingerprint([file])
    os.utime(file, (0, 0))
    assert stages.fingerprint([file]) == before
    file.write_text("int64 code\n")
    assert stages.fingerprint([file]) != before
    assert stages.fingerprint([file.rename(tmp_path / "Code.msg")]) != stages.fingerprint([])


def distribution(site: Path, name: str, version: str, url: str = "") -> Path:
    folder = site / f"{name}-{version}.dist-info"
    folder.mkdir(parents=True)
    if url:
        (folder / "direct_url.json").write_text(
            json.dumps({"url": url, "dir_info": {"editable": True}})
        )
    return folder


def test_a_wheel_that_is_gone_or_of_another_version_is_noticed(
    distributions: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    constraints = tmp_path / "constraints.txt"
    run = tmp_path / "run.txt"
    constraints.write_text("# pins\nnumpy==2.0\nRuamel.yaml==0.1\nempy==4.2\nelsewhere==1.0\n")
    run.write_text("-c constraints.txt\nnumpy\nruamel-yaml[extra]\n")
    monkeypatch.setattr(distributions, "CONSTRAINTS", constraints)
    monkeypatch.setattr(distributions, "STAMPS", tmp_path)
    site = tmp_path / "site"
    numpy = distribution(site, "numpy", "2.0")
    distribution(site, "ruamel_yaml", "0.1")
    before = distributions.installed(site)
    distribution(site, "empy", "3.3")
    assert distributions.missing_wheels(site, run) == []  # nobody asks for empy and elsewhere
    distributions.note_what_came(site, run, before)
    assert distributions.missing_wheels(site, run) == ["empy"]
    numpy.rename(site / "numpy-1.9.dist-info")
    assert distributions.missing_wheels(site, run) == ["empy", "numpy"]


def test_a_package_that_is_not_installed_from_here_is_noticed(
    distributions: ModuleType, tmp_path: Path
) -> None:
    here, away, gone = (tmp_path / "src" / name for name in ("ir_here", "ir_away", "ir_gone"))
    site = tmp_path / "site"
    distribution(site, "ir_here", "0.1.0", here.as_uri())
    distribution(site, "ir_away", "0.1.0", (tmp_path / "other" / "ir_away").as_uri())
    assert distributions.missing_editable(site, (here, away, gone)) == ["ir_away", "ir_gone"]
    assert distributions.said(["ir_away", "ir_gone"]) == " (missing: ir_away, ir_gone)"


def test_stages_run_side_by_side_and_install_one_after_another(
    set_up: ModuleType, stages: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stages, "LOGS", tmp_path)
    monkeypatch.setattr(stages, "STAMPS", tmp_path)
    os.mkfifo(tmp_path / "meet")  # opening it waits for who opens the other end
    meets = "import os, signal\nsignal.alarm(60)\nos.open('meet', os.{0})\n"
    alone = "import pathlib\nme = pathlib.Path('lock')\nme.touch(exist_ok=False)\nme.unlink()\n"
    both = [
        stages.Stage(
            name, name, "now", list, builds=(sys.executable, "-c", meets.format(end)),
            installs=(sys.executable, "-c", alone), folder=tmp_path,
        )
        for name, end in (("a", "O_RDONLY"), ("b", "O_WRONLY"))
    ]  # fmt: skip
    done = {stage.name for stage, _ in set_up.side_by_side(both, tmp_path)}
    assert done == {"a", "b"}
    assert not any(set_up.needed(stage) for stage in both)


def test_a_stage_that_fails_says_why_after_the_others_have_ended(
    set_up: ModuleType, stages: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stages, "LOGS", tmp_path)
    monkeypatch.setattr(stages, "STAMPS", tmp_path)
    bad = stages.Stage(
        "bad", "bad", "now", list, installs=(sys.executable, "-c", "raise SystemExit('no disk')")
    )
    good = stages.Stage("good", "good", "now", list, builds=(sys.executable, "-c", ""))
    with pytest.raises(set_up.SetupError, match="no disk"):
        list(set_up.side_by_side([bad, good], tmp_path))
    assert set_up.needed(bad)
    assert not set_up.needed(good)


def test_a_stage_begins_when_those_that_it_needs_are_done(
    set_up: ModuleType, stages: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stages, "LOGS", tmp_path)
    monkeypatch.setattr(stages, "STAMPS", tmp_path)

    def stage(name: str, code: str, *after: str) -> object:
        command = (sys.executable, "-c", f"from pathlib import Path; {code}")
        return stages.Stage(name, name, "now", list, after=after, builds=command, folder=tmp_path)

    first = stage("first", "Path('made').touch(exist_ok=False)", "done before")
    second = stage("second", "Path('made').unlink()", "first")
    assert [done.name for done, _ in set_up.side_by_side([first, second], tmp_path)] == [
        "first",
        "second",
    ]
    bad = stage("bad", "raise SystemExit('no compiler')")
    needs_it = stage("needs it", "Path('ran').touch()", "bad")
    with pytest.raises(set_up.SetupError, match="no compiler"):
        list(set_up.side_by_side([bad, needs_it], tmp_path))
    assert not (tmp_path / "ran").exists()
    assert set_up.needed(needs_it)


def test_every_stage_stands_after_those_that_it_needs(stages: ModuleType) -> None:
    known: set[str] = set()
    for stage in stages.Stages("3.11").all(tests=True, portable=True):
        assert set(stage.after) <= known
        known.add(stage.name)
    assert "core_baseline" not in {stage.name for stage in stages.Stages("3.11").all(False, False)}
    assert "core_baseline" in {stage.name for stage in stages.Stages("3.11").all(True, False)}


def test_what_is_installed_here_is_complete(
    distributions: ModuleType, stages: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every wheel that this interpreter was given is there in its pinned version."""
    site = Path(pytest.__file__).parents[1]
    monkeypatch.setattr(distributions, "STAMPS", site.parents[2] / ".setup")
    for requirements in (stages.TOOLS, stages.BUILD, stages.RUN, stages.TESTS):
        assert distributions.missing_wheels(site, requirements) == []


def test_every_requirement_is_pinned_in_one_version() -> None:
    def names(file: str) -> list[str]:
        lines = (ROOT / "requirements" / file).read_text().splitlines()
        bare = [re.split(r"[\[=<>~!; ]", line)[0] for line in lines if line and line[0] not in "#-"]
        return [re.sub(r"[-_.]+", "-", name).lower() for name in bare]

    pins = [
        line
        for line in (ROOT / "requirements" / "constraints.txt").read_text().splitlines()
        if line[:1] not in ("", "#")
    ]
    assert [
        pin for pin in pins if not re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][0-9A-Za-z.]*", pin)
    ] == []
    pinned = names("constraints.txt")
    assert len(pinned) == len(set(pinned))
    assert {*names("tools.txt"), *names("build.txt"), *names("run.txt"), *names("dev.txt")} <= set(
        pinned
    )


def test_the_interface_package_names_the_pinned_versions() -> None:
    pins = set((ROOT / "requirements" / "constraints.txt").read_text().splitlines())
    project = (ROOT / "ros_ws" / "src" / "ir_msgs" / "pyproject.toml").read_text()
    named = {pin.replace("[fastrtps]", "") for pin in re.findall(r'"(ros-[^"]*==[^"]*)"', project)}
    assert named
    assert named <= pins


def test_help_lists_every_target() -> None:
    makefile = (ROOT / "Makefile").read_text()
    phony = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)
    assert phony is not None
    shown = subprocess.run(
        ["make", "--no-print-directory", "help"], cwd=ROOT, capture_output=True, text=True
    ).stdout
    assert {line.split()[0] for line in shown.splitlines()[1:]} == set(phony.group(1).split())


def test_continuous_integration_runs_the_two_commands() -> None:
    script = ROOT / ".ci" / "run"
    assert os.access(script, os.X_OK)
    called = re.findall(
        r"^(?:nice -n \d+ )?make (?:--\S+ )?([\w-]+)", script.read_text(), re.MULTILINE
    )
    assert called == ["setup-tests", "check", "test"]
