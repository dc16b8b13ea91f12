"""The commands of `ir`: their names, groups, help and examples, and the names that they had.

A command is a function that adds its arguments to a parser and sets `run`. Its module is imported
when the command is chosen: `ir --help` imports none, `ir cell check` does not wait for rclpy.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from textwrap import fill

_WIDTH = 80


@dataclass(frozen=True)
class Command:
    """path: its words, "ask move". adds: "module:function" that adds its arguments. help: its line
    in a list; about: what it does, as a sentence; example: a command line. old: names that it had,
    which run with a notice. ros: whether it talks to nodes.
    """

    path: str
    adds: str
    help: str
    about: str
    example: str
    old: tuple[str, ...] = ()
    ros: bool = False

    @property
    def group(self) -> str:
        """Its group; "" for a command of the first page."""
        first = self.path.partition(" ")[0]
        return first if first in GROUPS else ""

    def parser(self) -> argparse.ArgumentParser:
        """Its parser, with all arguments."""
        parser = argparse.ArgumentParser(
            prog=f"ir {self.path}",
            description=fill(self.about, _WIDTH),
            epilog=f"example:\n  {self.example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module, _, function = self.adds.partition(":")
        getattr(import_module(module), function)(parser)
        return parser


GROUPS = {
    "cell": "cell files: begin, check, import from CAD, export, list",
    "robot": "robot files: check, make from a URDF, list",
    "krl": "KUKA programs: cost in a cell, and planned programs as KRL",
    "energy": "measurements: compare, fit power parameters, many robots on one page",
    "study": "many plans: layout, statistics, planners against each other",
    "ros": "running nodes: start, watch, call, plan again",
    "ask": "single questions: a movement, a path, configurations, a trace, a pause",
}

COMMANDS = (
    Command(
        "new",
        "ir_cli.cells:add_new",
        "begin a cell file: a robot, two tables and a program that plans",
        "Writes a cell file to begin with, in the size of its robot; its program plans.",
        "ir new my_cell.yaml --robot kr6_r900_2",
        ("cell new",),
    ),
    Command(
        "new search",
        "ir_cli.new_search:add_new_search",
        "begin a package with a search of your own",
        "Writes a small package with a search that works, which the planner finds by its entry "
        "point once it is installed.",
        "ir new search over_the_top",
    ),
    Command(
        "check",
        "ir_cli.cells:add_check",
        "everything that is wrong with a cell file, and access to its stations",
        "Names every error of a cell file with its line, and what the robot reaches at each "
        "station.",
        "ir check my_cell.yaml --deep",
        ("cell check",),
    ),
    Command(
        "plan",
        "ir_cli.plan:add_plan",
        "plan a cell's program: seconds, joules, clearance",
        "Plans the program of a cell, or movements between stations of it, for least energy and "
        "time; every movement is certified.",
        "ir plan demo --saving -o out/plan.html",
    ),
    Command(
        "compare",
        "ir_cli.compare:add_compare",
        "today's program (KRL, a trace, or PTP at 100 %) against the planner's",
        "Compares a program as it runs today with programs of the planner, change by change, as a "
        "table and a page.",
        "ir compare my_cell.yaml old.src old.dat --cycle-time 30",
    ),
    Command(
        "export",
        "ir_cli.export:add_export",
        "a planned program as KRL, or the machines of a cell as SDF, URDF or glTF",
        "Writes a planned program as KRL (.src and .dat), or the machines of a cell as a world "
        "(.sdf, .urdf, .glb); the ending of the file says which.",
        "ir export demo -o out/demo.src",
    ),
    Command(
        "report",
        "ir_cli.reports:add_report",
        "the HTML report of a recording, or of several side by side",
        "Explains a recording as one HTML page that opens offline; several are compared on one.",
        "ir report out/demo.mcap -o out/report.html",
    ),
    Command(
        "view",
        "ir_cli.view.command:add_view",
        "a cell in a browser: planned, moved about, replayed, or as it drives (--live)",
        "Serves a cell in a browser of this machine until Ctrl-C: a file is planned again whenever "
        "it changes or something is moved, a recording is replayed, with --live running nodes are "
        "watched.",
        "ir view demo",
        ("live", "ros live"),
    ),
    Command(
        "demo",
        "ir_cli.ros.demo_command:add_demo",
        "plan, drive, record and explain a cell with real nodes",
        "Plans, drives, records and explains a cell, with real nodes and a simulated robot; exit "
        "code 0 when every check of the recording held.",
        "ir demo --cell demo -o out",
        ros=True,
    ),
    Command(
        "completion",
        "ir_cli.completion:add_completion",
        "completion for bash, zsh and tcsh: source <(ir completion)",
        "Prints a script that completes commands, options and choices; elsewhere file names.",
        "source <(ir completion bash)",
    ),
    Command(
        "cell import",
        "ir_cli.cell_worlds:add_import",
        "a mesh from CAD as a line to paste, or a world as a cell",
        "Divides a mesh into convex pieces and prints its line for a cell file, or prints a cell "
        "with the machines of a world.",
        "ir cell import press.stl --unit mm",
    ),
    Command(
        "cell export",
        "ir_cli.cell_worlds:add_export",
        "the machines of a cell as SDF, URDF or glTF",
        "Writes the machines of a cell as a world of a simulator, or as glTF; no file is "
        "overwritten.",
        "ir cell export demo -o world.sdf",
    ),
    Command(
        "cell list",
        "ir_cli.cells:add_list",
        "the bundled cells",
        "Lists the cells that come with the project.",
        "ir cell list",
    ),
    Command(
        "robot new",
        "ir_cli.robots:add_new",
        "a robot file from a URDF or xacro file",
        "Writes a robot file from a URDF, with fitted capsules, what the URDF lacks estimated, and "
        "a free posture; it is read back and checked first.",
        "ir robot new arm.urdf --payload 20 --mass 250",
    ),
    Command(
        "robot check",
        "ir_cli.robots:add_check",
        "what a robot file lacks, before anything is planned",
        "Names every error of a robot file, and what its data mean for planning.",
        "ir robot check robot.yaml",
    ),
    Command(
        "robot list",
        "ir_cli.robots:add_list",
        "robots that a cell file may name, with their payload",
        "Lists the robots that come with the project.",
        "ir robot list",
    ),
    Command(
        "krl import",
        "ir_cli.krl:add_import",
        "drive a .src (with its .dat) as a KR C4 would, in a cell",
        "Drives a KUKA program as a KR C4 would and prints seconds, joules and clearance by line.",
        "ir krl import old.src old.dat --cell my_cell.yaml",
    ),
    Command(
        "krl export",
        "ir_cli.krl:add_export",
        "plan a program and write it as .src and .dat, certified again",
        "Plans a program and writes it as KRL; the written motions are certified again as the "
        "controller drives them.",
        "ir krl export demo -o out/demo.src",
    ),
    Command(
        "energy compare",
        "ir_cli.energy:add_compare",
        "the meter beside the energy from positions, by movement",
        "Compares the measured energy of every movement of a recording with the one that follows "
        "from its positions.",
        "ir energy compare out/demo.mcap",
    ),
    Command(
        "energy fit",
        "ir_cli.energy:add_fit",
        "power parameters from a meter, with what is left uncertain",
        "Fits the power parameters of a robot to a meter and writes them with their deviations.",
        "ir energy fit run.mcap --meter meter.csv -o out/power.yaml",
    ),
    Command(
        "energy excite",
        "ir_cli.energy:add_excite",
        "plan movements that identify power parameters",
        "Plans certified movements and rests from whose watts the power parameters can be "
        "identified.",
        "ir energy excite demo --seconds 60 -o out/excitation",
    ),
    Command(
        "energy drive",
        "ir_cli.energy:add_drive",
        "drive such a programme on a simulated plant",
        "Drives the programme of `ir energy excite` on a simulated plant and writes its readings.",
        "ir energy drive out/excitation --plant typical:3",
    ),
    Command(
        "energy fleet",
        "ir_cli.reports:add_fleet",
        "recordings of many robots and shifts on one page, summed up",
        "Sums up recordings and plans of many robots and shifts on one page.",
        "ir energy fleet out/factory -o out/fleet.html",
        ("fleet",),
    ),
    Command(
        "study layout",
        "ir_cli.studies:add_layout",
        "where robot, machines, posture and tool should stand for least energy",
        "Searches where robot, machines, posture and tool should stand for least energy; an "
        "interrupted study goes on with the same command.",
        "ir study layout layout.yaml -o out/layout",
    ),
    Command(
        "study statistics",
        "ir_cli.studies:add_statistics",
        "time and energy over random movements, predicted and measured",
        "Plans random movements with synchronous and asynchronous joints, drives them on a "
        "simulated robot and compares; an interrupted study goes on with the same command.",
        "ir study statistics statistics.yaml -o out/statistics",
    ),
    Command(
        "study arena",
        "ir_cli.studies:add_arena",
        "planners against each other over cells, tasks and seeds",
        "Runs planners against each other over cells, tasks and seeds; an interrupted arena goes "
        "on with the same command.",
        "ir study arena --quick",
        ("arena",),
    ),
    Command(
        "study cells",
        "ir_cli.studies:add_cells",
        "robotic cells of the public benchmark: the cheapest cycle, with a proven gap",
        "Finds order, places, speeds and power modes of the robots of a cell for least energy in "
        "its cycle; instances are those of the generator of robotic cells of CTU in Prague.",
        "ir study cells FILE.xml",
    ),
    Command(
        "ros up",
        "ir_cli.ros.up:add_up",
        "start planner, driver, runner and recorder until Ctrl-C",
        "Starts the four nodes of a cell without a launch file and ends them with Ctrl-C.",
        "ir ros up --cell demo",
        ("up",),
        ros=True,
    ),
    Command(
        "ros call",
        "ir_cli.ros.graph:add_call",
        "call a service: call /ir_planner/get_cell '{}'",
        "Calls a service and prints its response; exit code 1 when its status is no success.",
        "ir ros call /ir_planner/get_cell '{}'",
        ("call",),
        ros=True,
    ),
    Command(
        "ros echo",
        "ir_cli.ros.graph:add_echo",
        "print a topic's messages: echo /ir_sim_driver/power_state",
        "Prints the messages of a topic until Ctrl-C.",
        "ir ros echo /ir_sim_driver/power_state --once",
        ("echo",),
        ros=True,
    ),
    Command(
        "ros list",
        "ir_cli.ros.graph:add_list",
        "list services, topics or actions with their types",
        "Lists services, topics or actions of the running nodes with their types.",
        "ir ros list topics",
        ("list",),
        ros=True,
    ),
    Command(
        "ros send_goal",
        "ir_cli.ros.graph:add_send_goal",
        "send a goal: send_goal /ir_planner/plan '{}'; Ctrl-C cancels",
        "Sends a goal to an action, waits and prints its result; Ctrl-C cancels it.",
        "ir ros send_goal /ir_planner/plan '{}' --feedback",
        ("send_goal",),
        ros=True,
    ),
    Command(
        "ros cancel",
        "ir_cli.ros.graph:add_cancel",
        "cancel all goals of an action: cancel /ir_planner/plan",
        "Cancels all goals of an action.",
        "ir ros cancel /ir_planner/plan",
        ("cancel",),
        ros=True,
    ),
    Command(
        "ros front",
        "ir_cli.ros.front:add_front",
        "energy over cycle time: front home infeed_pick park",
        "Plans the front of a program's energy over its cycle time by a running planner, as a "
        "table and a picture.",
        "ir ros front --points 8 -o out/front.png",
        ("front",),
        ros=True,
    ),
    Command(
        "ros replan",
        "ir_cli.ros.replan:add_replan",
        "plan a recording's requests again and compare the ids",
        "Plans the requests of a recording again, with what the planner had then, and compares the "
        "ids; exit code 0 where all are equal.",
        "ir ros replan out/demo.mcap",
        ("replan",),
        ros=True,
    ),
    Command(
        "ask move",
        "ir_cli.ask:add_move",
        "plan one movement from START to GOAL",
        "Plans one movement between two configurations and prints what it costs.",
        "ir ask move demo home infeed_pick",
        ("move",),
    ),
    Command(
        "ask escape",
        "ir_cli.ask:add_escape",
        "a way out of where the robot stands too near, or beyond a limit",
        "Plans a slow way out of a place where something is too near or touched, or a joint is "
        "beyond its limit, on which nothing gets worse.",
        "ir ask escape demo 'A1 0 A2 -3 A3 90 A4 0 A5 0 A6 0'",
    ),
    Command(
        "ask path",
        "ir_cli.ask:add_path",
        "drive the tool along a path at a given speed",
        "Plans the joints for a path of the tool at a given speed and prints what it costs.",
        "ir ask path cartesian seam --t1",
        ("path",),
    ),
    Command(
        "ask ik",
        "ir_cli.ask:add_ik",
        "all configurations that reach a pose or a station",
        "Prints the free configurations that reach a pose or a station, cheapest first.",
        "ir ask ik demo infeed_pick",
        ("ik",),
    ),
    Command(
        "ask state",
        "ir_cli.ask:add_check",
        "whether a configuration is free, and its nearest pairs",
        "Says whether a configuration keeps the safety distance, and prints its nearest pairs.",
        "ir ask state demo home --pairs 3",
    ),
    Command(
        "ask standby",
        "ir_cli.ask:add_standby",
        "the power mode of least energy for a pause",
        "Chooses the power mode of least energy for a pause, and prints it beside the others.",
        "ir ask standby demo --pause 120",
        ("standby",),
    ),
    Command(
        "ask evaluate",
        "ir_cli.trace_commands:add_evaluate",
        "joules, limits and clearance of a trajectory in a file",
        "Evaluates a measured or planned trace: joules, clearance, and every limit that it "
        "violates.",
        "ir ask evaluate demo trace.csv",
        ("evaluate",),
    ),
    Command(
        "ask optimize",
        "ir_cli.trace_commands:add_optimize",
        "make the motion of a trace cheaper between its ends",
        "Optimises the motion of a trace between its ends.",
        "ir ask optimize demo trace.csv -o faster.csv",
        ("optimize",),
    ),
)
BY_PATH = {command.path: command for command in COMMANDS}
OLD = {
    **{old: command.path for command in COMMANDS for old in command.old},
    "cell new": "new",
    "cell check": "check",
}
"""Old names and the new ones. `ir check CELL STATE` is an old one, too: `ir ask state`."""
IMPLIED = {"live": "--live", "ros live": "--live"}
"""Options that an old name stands for."""
QUIET = ("cell new", "cell check")
"""Names that stay beside the short ones: they run without a notice."""
NAMES = (*(each.path for each in COMMANDS if not each.group), *GROUPS)
"""First words of the first help page."""


def first_page() -> str:
    """The help of `ir`."""
    commands = [(each.path, each.help) for each in COMMANDS if not each.group]
    lines = [
        "usage: ir COMMAND ...",
        "",
        "Energy-aware planning for industrial robots.",
        "",
        "commands:",
        *_listed(commands),
        "",
        "groups (ir GROUP --help lists their commands):",
        *_listed(list(GROUPS.items())),
        "",
        "options:",
        *_listed([("-h, --help", "show this help and exit"), ("--version", "show the version")]),
        "",
        "example:",
        "  ir plan demo",
    ]
    return "\n".join(lines) + "\n"


def group_page(group: str) -> str:
    """The help of a group."""
    own = [(each.path, each.help) for each in COMMANDS if each.group == group]
    own += [(name, BY_PATH[OLD[name]].help) for name in QUIET if name.startswith(f"{group} ")]
    example = next(each.example for each in COMMANDS if each.group == group)
    lines = [f"usage: ir {group} COMMAND ...", "", _sentence(GROUPS[group]), "", "commands:"]
    return "\n".join([*lines, *_listed(own), "", "example:", f"  {example}"]) + "\n"


def renamed(words: Sequence[str]) -> tuple[str, int, str]:
    """The path of the command that words begin with, how many of them name it, and a notice where
    they are an old name. The path is "" where no command has such a name.
    """
    for count in (2, 1):
        name = " ".join(words[:count])
        if name in BY_PATH:
            if name == "check" and _positionals(words[1:]) > 1:
                return "ask state", 1, _notice("check CELL STATE", "ask state CELL STATE")
            return name, count, ""
        if name in OLD:
            new = f"{OLD[name]} {IMPLIED.get(name, '')}".strip()
            return OLD[name], count, "" if name in QUIET else _notice(name, new)
    return "", 0, ""


def without_name(words: Sequence[str], count: int) -> list[str]:
    """The words after the `count` that name a command, with the option that an old name stands
    for.
    """
    option = IMPLIED.get(" ".join(words[:count]), "")
    return [*([option] if option else []), *words[count:]]


def with_cell(words: Sequence[str], parser: argparse.ArgumentParser) -> list[str]:
    """The words with the value of --cell as the first argument, where the command has it there."""
    named = [action.dest for action in parser._actions if not action.option_strings]
    if "--cell" in parser._option_string_actions or "cell" not in named[:1]:
        return list(words)
    left = list(words)
    for k, word in enumerate(left):
        if word == "--":
            break
        if word.startswith("--cell="):
            return [word.partition("=")[2], *left[:k], *left[k + 1 :]]
        if word == "--cell" and k + 1 < len(left):
            return [left[k + 1], *left[:k], *left[k + 2 :]]
    return left


def _positionals(words: Sequence[str]) -> int:
    """Words of the old `ir check` that are no options and no values of them."""
    valued = ("--station", "--pairs", "--safety-distance", "--load")
    pairs = zip(("", *words), words, strict=False)
    return sum(not word.startswith("--") and before not in valued for before, word in pairs)


def _notice(old: str, new: str) -> str:
    return f"ir: `ir {old}` is now `ir {new}`\n"


def _listed(rows: Sequence[tuple[str, str]]) -> list[str]:
    width = max(len(name) for name, _ in rows)
    return [f"  {name.ljust(width)}  {help_}" for name, help_ in rows]


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."
