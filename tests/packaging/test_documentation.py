"""The documentation names what exists: links, files, functions, tests."""

from __future__ import annotations

import importlib
import importlib.util
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest
import yaml

from ir_cli.commands import NAMES, OLD
from ir_msgs_py import names

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
PACKAGES = {path.name for path in (ROOT / "src").iterdir()}
HISTORY = {"CHANGELOG.md"}  # names what existed when it was written

LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"`([^`\n]+)`")
TEST = re.compile(r"^(?:tests/)?(?:\w+/)*(test_\w+\.py)?(?:::(\w+))?$")
FILE = re.compile(r"^\.?[\w-]+(?:/[\w.-]+)+/?$|^[\w-]+\.(?:py|yaml|md|sh|cpp|hpp)$")


def text_of(page: Path) -> str:
    """The page without its code blocks."""
    return re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)


def code_spans(page: Path) -> Iterator[str]:
    return (match[1] for match in CODE.finditer(text_of(page)))


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", text_of(page), re.MULTILINE)
    return {
        re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings
    }


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_relative_links_lead_to_a_file_and_to_a_heading(page: Path) -> None:
    broken = []
    for target in LINK.findall(text_of(page)):
        if re.match(r"\w+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (anchor and file.suffix == ".md" and anchor not in anchors(file)):
            broken.append(target)
    assert broken == []


def module_at(dotted: str) -> ModuleType | None:
    """The module of that name, None where there is none."""
    try:
        return importlib.import_module(dotted)
    except ModuleNotFoundError as missing:
        if missing.name is not None and f"{dotted}.".startswith(f"{missing.name}."):
            return None
        raise


def exists(dotted: str) -> bool:
    """Whether package.module.name leads to a module or to what it holds."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        found: object = module_at(".".join(parts[:count]))
        if found is not None:
            for part in parts[count:]:
                fields = getattr(found, "__dataclass_fields__", {})
                found = getattr(found, part, fields.get(part))
                if found is None:
                    return False
            return True
    return False


def dotted_names(page: Path) -> Iterator[str]:
    """`package.module.function` in the page; `.function` continues the name before it in the same
    line.
    """
    for line in text_of(page).splitlines():
        module = ""
        for code in CODE.findall(line):
            match = re.match(r"(\w*(?:\.\w+)+)(?:\(|$)", code)
            if match is None or FILE.match(match[1]):
                continue
            dotted = module + match[1] if match[1].startswith(".") else match[1]
            if dotted.partition(".")[0] in PACKAGES:
                module = dotted.rpartition(".")[0]
                yield dotted


@pytest.mark.parametrize("page", [p for p in PAGES if p.name not in HISTORY], ids=name_of)
def test_functions_that_are_named_exist(page: Path) -> None:
    assert [name for name in dotted_names(page) if not exists(name)] == []


@cache
def texts_by_file() -> dict[str, str]:
    """Text of all test files of a name."""
    texts: dict[str, str] = {}
    for path in (*ROOT.glob("tests/**/test_*.py"), *ROOT.glob("src/*/*/contract/test_*.py")):
        texts[path.name] = texts.get(path.name, "") + path.read_text("utf-8")
    return texts


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_tests_that_are_named_exist(page: Path) -> None:
    """`file.py::test`; `::test` continues the file of the test before it."""
    missing = []
    file = ""
    for code in code_spans(page):
        match = TEST.match(code)
        if match is None or not (match[1] or match[2]):
            continue
        file = match[1] or file
        text = texts_by_file().get(file, "")
        if not text or (match[2] and f"def {match[2]}(" not in text):
            missing.append(code)
    assert missing == []


@cache
def tracked_names() -> frozenset[str]:
    """Names of all files and folders of the repository that hold something of its own."""
    trees = (
        "src",
        "tests",
        "docs",
        "benchmarks",
        "tools",
        "examples",
        "ros_ws",
        "docker",
        "requirements",
        ".ci",
    )
    return frozenset(path.name for tree in trees for path in (ROOT / tree).rglob("*"))


@pytest.mark.parametrize("page", [p for p in PAGES if p.name not in HISTORY], ids=name_of)
def test_files_that_are_named_exist(page: Path) -> None:
    """A path from the root or from the page; a bare `name.py` anywhere; not NAME, not out/."""
    missing = []
    for code in code_spans(page):
        name = code.split()[0]
        if (
            not FILE.match(name)
            or "NAME" in name
            or name.startswith(("out/", ".venv/", "ros_ws/install"))
        ):
            continue
        top = name.partition("/")[0]
        if "/" not in name:
            found = name in tracked_names() or (ROOT / name).exists()
        elif (ROOT / top).exists() or top in PACKAGES:
            found = any(
                (base / name).exists()
                for base in (ROOT, page.parent, ROOT / "src" / top, ROOT / "ros_ws/src")
            )
        else:
            continue  # a type, a topic or a unit
        if not found:
            missing.append(name)
    assert missing == []


def test_a_name_that_does_not_exist_is_noticed() -> None:
    assert exists("ir_kernels.ccd")
    assert exists("ir_kernels")
    assert not exists("ir_kernels.no_such_module.f")
    assert not exists("ir_kernels.ccd.no_such_function")


@pytest.mark.parametrize(
    "name",
    [
        "architecture_page",
        "interface_reference",
        "mistakes_page",
        "parameter_reference",
        pytest.param("readme_figures", marks=pytest.mark.long),
    ],
)
def test_a_page_that_is_written_from_code_is_as_the_code_is(name: str) -> None:
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    sys.modules[name] = tool  # dataclasses look their module up
    spec.loader.exec_module(tool)
    assert tool.PAGE.read_text("utf-8") == tool.page(), "run `make docs`"


def test_the_citation_names_version_and_licence_of_the_packages() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    setups = [path.read_text("utf-8") for path in (ROOT / "src").glob("*/setup.py")]
    assert setups
    for setup in setups:
        assert f'version="{citation["version"]}"' in setup
        assert f'license="{citation["license"]}"' in setup


def commands() -> set[str]:
    """What a user can type: console scripts with a hyphen, subcommands of `ir`, targets of make."""
    setups = "".join(path.read_text("utf-8") for path in (ROOT / "src").glob("*/setup.py"))
    targets = re.findall(r"^\.PHONY: (.*)", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)[
        0
    ].split()
    scripts = re.findall(r'"(ir-\w+) = ', setups)
    return {
        *scripts,
        *(f"ir {name}" for name in NAMES),
        *(f"make {name}" for name in targets),
    }


@pytest.mark.parametrize("page", [*PAGES, *sorted((ROOT / "examples").glob("*.py"))], ids=name_of)
def test_commands_that_are_named_exist(page: Path) -> None:
    spans = re.findall(
        r"```.*?```|`[^`\n]+`|^ {4}.*?$", page.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    named = re.findall(
        r"(?<![\w-])((?:ir|make) [a-z][\w-]*|ir(?:-\w+)+)(?![\w/-])", "\n".join(spans)
    )
    old = {f"ir {name.split()[0]}" for name in OLD} if page.name == "commands.md" else set()
    assert set(named) - commands() - old == set()


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_interfaces_that_are_named_exist(page: Path) -> None:
    """`srv/Name`, `msg/Name`, `action/Name`, also after `ir_msgs/`; not those of other packages."""
    named = re.findall(
        r"(?:(?<![\w/])|ir_msgs/)((?:srv|msg|action)/[A-Z]\w+)", page.read_text("utf-8")
    )
    files = (ROOT / "ros_ws" / "src" / "ir_msgs").glob("*/*.*")
    assert set(named) <= {f"{path.parent.name}/{path.stem}" for path in files}


def test_the_page_of_interfaces_names_everything_that_the_nodes_offer() -> None:
    page = (ROOT / "docs" / "interfaces.md").read_text("utf-8")
    sections = re.findall(r"^## (ir_\w+)\n(.*?)(?=^## )", page, re.DOTALL | re.MULTILINE)
    named = {f"{node}/{name}" for node, text in sections for name in re.findall(r"`~/(\w+)`", text)}
    offered = {value for key, value in vars(names).items() if key.isupper() and "/" in str(value)}
    assert named == {value for value in offered if not value.startswith("/")}


def test_decisions_are_numbered_without_a_gap_or_a_double() -> None:
    decisions = sorted((ROOT / "docs" / "decisions").glob("0*.md"))
    numbers = [int(path.name[:4]) for path in decisions]
    assert numbers == list(range(1, len(decisions) + 1))
    for path in decisions:
        assert path.read_text("utf-8").startswith(f"# {int(path.name[:4])}. ")


def test_extending_names_every_suite_of_contracts() -> None:
    page = (ROOT / "docs" / "extending.md").read_text("utf-8")
    suites = [*ROOT.glob("tests/contract/test_*.py"), *ROOT.glob("src/*/*/contract/test_*.py")]
    assert suites
    assert [path.stem for path in suites if path.stem not in page] == []


def test_where_is_what_begins_at_names_that_the_files_define() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    rows = page.partition("## Where is what")[2].partition("\n## ")[0]
    begins = re.findall(r"`(\w+)/([\w/]+\.py)`: ((?:`\w+`(?:, )?)+)", rows)
    assert len(begins) > 15
    for package, path, listed in begins:
        text = (ROOT / "src" / package / package / path).read_text("utf-8")
        for name in CODE.findall(listed):
            assert re.search(rf"^ *(def|class) {name}\b", text, re.MULTILINE), (path, name)
