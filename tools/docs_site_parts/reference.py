"""Reference pages from docstrings and from the help of commands."""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import inspect
import re
from collections.abc import Iterator
from importlib import import_module

from ir_cli.main import COMMAND_MODULES


def package_page(name: str) -> tuple[str, list[str]]:
    """The public face of a package as Markdown, and the names without a docstring."""
    package = importlib.import_module(name)
    missing = list[str]()
    lines = [f"# {name}", "", "Written from the docstrings of what the package exports.", ""]
    lines += [_prose(inspect.getdoc(package) or ""), ""]
    for exported in sorted(package.__all__, key=str.lower):
        thing = getattr(package, exported)
        if inspect.isclass(thing):
            lines += _class(exported, thing)
        elif inspect.isroutine(thing):
            lines += [f"## {exported}", "", *_function(exported, thing)]
        else:
            lines += [f"## {exported}", "", f"`{type(thing).__name__}`", ""]
            continue
        if not inspect.getdoc(thing):
            missing.append(f"{name}.{exported}")
    return "\n".join(lines), missing


def _class(name: str, thing: type) -> Iterator[str]:
    yield from (f"## {name}", "", _prose(inspect.getdoc(thing) or ""), "")
    if dataclasses.is_dataclass(thing):
        yield "Fields: " + ", ".join(
            f"`{f.name}`" for f in dataclasses.fields(thing) if f.name[0] != "_"
        )
        yield ""
    for key, member in vars(thing).items():
        if key[0] == "_" or isinstance(member, type):
            continue
        inner = getattr(
            member, "__func__", getattr(member, "fget", None) or getattr(member, "func", member)
        )
        if inspect.isfunction(inner) and inspect.getdoc(inner):
            yield from (f"### {name}.{key}", "", *_function(key, inner))


def _function(name: str, function: object) -> Iterator[str]:
    try:
        signature = str(inspect.signature(function))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        signature = "(...)"
    signature = re.sub(r" at 0x[0-9a-f]+", "", signature)
    yield from (
        "```python",
        f"{name}{signature}",
        "```",
        "",
        _prose(inspect.getdoc(function) or ""),
        "",
    )


def _prose(text: str) -> str:
    """A docstring as Markdown: what is indented or drawn stays as it is, stars are letters."""
    blocks = re.split(r"\n\s*\n", text)
    return "\n\n".join(
        f"```text\n{block}\n```" if block.startswith("    ") or "──" in block else _escaped(block)
        for block in blocks
        if block.strip() != "::"
    )


def _escaped(text: str) -> str:
    return re.sub(r"([*_<>\[\]#|])", r"\\\1", text)


def command_page() -> str:
    """The help of every command and its verbs."""
    lines = ["# Commands", "", "Written from what `ir COMMAND --help` prints.", ""]
    for module in dict.fromkeys(COMMAND_MODULES.values()):
        parser = argparse.ArgumentParser(prog="ir")
        commands = parser.add_subparsers()
        import_module(module).add_commands(commands)
        for name, command in commands.choices.items():
            lines += [f"## ir {name}", "", *_help(command)]
    return "\n".join(lines)


def _help(parser: argparse.ArgumentParser) -> Iterator[str]:
    parser.formatter_class = lambda prog: argparse.HelpFormatter(prog, width=100)
    yield from ("```text", parser.format_help().rstrip(), "```", "")
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                yield from _help(verb)
