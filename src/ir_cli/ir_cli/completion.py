"""`ir completion`: a script for bash, zsh or tcsh that completes commands, options and choices.

The script holds the words, so that a press of the tab key starts no Python; shtab writes it.
"""

from __future__ import annotations

import argparse
import sys

from ir_cli.commands import COMMANDS, GROUPS, OLD, QUIET
from ir_cli.errors import InputError

SHELLS = ("bash", "zsh", "tcsh")


def add_completion(completion: argparse.ArgumentParser) -> None:
    """Arguments of `ir completion`."""
    completion.add_argument("shell", nargs="?", default="bash", choices=SHELLS, help="(bash)")
    completion.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the script. InputError where shtab is missing."""
    try:
        import shtab
    except ImportError as error:
        raise InputError("ir completion needs shtab: pip install shtab") from error
    sys.stdout.write(shtab.complete(whole_parser(), arguments.shell) + "\n")
    return 0


def whole_parser() -> argparse.ArgumentParser:
    """One parser of all commands, with those of a group below it."""
    parser = argparse.ArgumentParser(prog="ir")
    parser.add_argument("--version", action="store_true", help="show the version")
    first = parser.add_subparsers()
    groups = {
        name: first.add_parser(name, help=words).add_subparsers() for name, words in GROUPS.items()
    }
    for command in COMMANDS:
        names = [command.path, *(old for old in OLD if old in QUIET and OLD[old] == command.path)]
        for path in names:
            group, _, name = path.rpartition(" ")
            if group and group not in GROUPS:
                continue  # `new search`: a word can't have words below it and arguments as well
            parent = groups[group] if group else first
            own = command.parser()
            parent.add_parser(
                name, help=command.help.replace("%", "%%"), parents=[own], add_help=False
            )
    return parser
