"""`ir completion`: a bash script that completes commands, options and choices; elsewhere file
names.

The script holds the words, so that a press of the tab key starts no Python.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from importlib import import_module

SCRIPT = """# completion of the ir command for bash: source <(ir completion)
_ir() {{
    local words=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        words={commands}
    else
        case "${{COMP_WORDS[1]}}" in
{cases}
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _ir ir
"""


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add completion."""
    completion = commands.add_parser(
        "completion", help="completion for bash: source <(ir completion)"
    )
    completion.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    from ir_cli.main import COMMAND_MODULES  # it knows this module by name only

    words: dict[str, list[str]] = {}
    for module in dict.fromkeys(COMMAND_MODULES.values()):
        commands = argparse.ArgumentParser(prog="ir").add_subparsers()
        import_module(module).add_commands(commands)
        words |= {name: _words(parser) for name, parser in commands.choices.items()}
    cases = [
        f"            {name}) words={shlex.quote(' '.join(each))} ;;"
        for name, each in words.items()
    ]
    text = SCRIPT.format(
        commands=shlex.quote(" ".join([*COMMAND_MODULES, "--help", "--version"])),
        cases="\n".join(cases),
    )
    sys.stdout.write(text)
    return 0


def _words(parser: argparse.ArgumentParser) -> list[str]:
    """Options of a command, and the choices of its words."""
    found: list[str] = []
    for action in parser._actions:
        found += action.option_strings
        if not action.option_strings and action.choices:
            found += [str(choice) for choice in action.choices]
    return found
