"""The PLC's part of an export: its table, and its structured text as a PLC would run it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import pytest

from ir_krl import KrlError
from ir_krl.write import PlcPause, plc_table, read_plc_table, structured_text
from ir_msgs_py.modes import Mode, TransitionTimes
from ir_msgs_py.plc import OperatingMode
from ir_planner.program import switch_times
from ir_sim_driver.controller.mode_control import ModeControl
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.notices import Notices
from ir_sim_driver.plc.inputs import Plc, PlcSettings

NUMBERS = {"IR_PAUSE": 33, "IR_PLC": 40, "IR_DONE": 41}
TIMES = TransitionTimes()


def pause(modes: str, seconds: float, number: int = 1) -> PlcPause:
    """A pause that is planned in these modes."""
    asked, wake_at = switch_times(modes, seconds, TIMES)
    names, at = zip(*asked, strict=True)
    return PlcPause(number, "home", seconds, names, at, wake_at)


def test_a_table_is_read_back() -> None:
    pauses = [pause("STAND_ON_BRAKES>BUS_POWER_OFF", 420.0), pause("HIBERNATION", 3000.125, 2)]
    assert list(read_plc_table(plc_table("MAIN", pauses), "main.plc.csv").values()) == pauses


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (("seconds", "secs"), "main.plc.csv:1:1: column seconds is missing"),
        (("420", "long"), "main.plc.csv:2:1: seconds is 'long': it must be a number"),
        (("420", "nan"), "seconds is nan: it must be in 0 .. 604800"),
        (("BUS_POWER_OFF", "BUS_OFF"), "power mode 'BUS_OFF' of the pause is unknown"),
        (("0>1.3", "0"), "need one time each in asked_at"),
        ((",400", ",500"), "wake_at is 500: it must be in 0 .. 420"),
        (("MAIN,1", "MAIN,1.5"), "pause is 1.5: it must be a whole number"),
    ],
)
def test_a_wrong_table_is_refused_with_its_place(wrong: tuple[str, str], sentence: str) -> None:
    text = plc_table("MAIN", [pause("STAND_ON_BRAKES>BUS_POWER_OFF", 420.0)])
    assert wrong[0] in text
    with pytest.raises(KrlError) as error:
        read_plc_table(text.replace(*wrong), "main.plc.csv")
    assert sentence in str(error.value)


def test_a_mode_that_the_function_block_has_no_time_for_is_refused() -> None:
    planned = PlcPause(3, "home", 420.0, ("STAND_ON_BRAKES", "NAP"), (0.0, 1.3), 400.0)
    with pytest.raises(KrlError, match="pause 3: a PLC's program has no time for NAP"):
        structured_text("MAIN", [planned], NUMBERS, [])


# Structured text as Python: assignments, IF, CASE and two timers are all that it has.


@dataclass
class Ton:
    """IEC's on-delay timer."""

    since: float = -1.0
    Q: bool = False
    ET: float = 0.0

    def run(self, on: bool, preset: float, now: float) -> None:
        self.since = (self.since if self.since >= 0.0 else now) if on else -1.0
        self.ET = min(now - self.since, preset) if on else 0.0
        self.Q = on and preset <= self.ET


_SECONDS = {"ms": 0.001, "s": 1.0, "d": 86_400.0}


def python_of(text: str) -> str:
    """The body of a function block as Python over `v` (variables) and `now`."""
    body = text.split("END_VAR")[-1].replace("END_FUNCTION_BLOCK", "")
    body = re.sub(r"\(\*.*?\*\)", " ", body, flags=re.DOTALL)
    body = re.sub(r"T#(\d+)(ms|s|d)", lambda m: str(float(m[1]) * _SECONDS[m[2]]), body)
    body = re.sub(r"TIME_TO_LREAL\((\w+)\.ET\)", r"(1000.0 * \1.ET)", body)
    lines: list[str] = []
    depth = 0
    for part in re.split(r";|(?<=THEN)|(?<=OF)|(?<=ELSE)|(?<=\d:)", " ".join(body.split())):
        statement = part.strip()
        if not statement:
            continue
        if match := re.fullmatch(r"(IF|ELSIF) (.*) THEN", statement):
            depth -= match[1] == "ELSIF"
            word = "elif" if match[1] == "ELSIF" else "if"
            lines.append("  " * depth + f"{word} {_expression(match[2])}:")
            depth += 1
        elif match := re.fullmatch(r"CASE (\w+) OF", statement):
            lines.append("  " * depth + f"if v.{match[1]} == -1: pass")
            subject = match[1]
            depth += 1
        elif match := re.fullmatch(r"(\d+):", statement):
            lines.append("  " * (depth - 1) + f"elif v.{subject} == {match[1]}:")
        elif statement == "ELSE":
            lines.append("  " * (depth - 1) + "else:")
        elif statement in ("END_IF", "END_CASE"):
            depth -= 1
        elif match := re.fullmatch(r"(\w+)\(IN := (.*), PT := (.*)\)", statement):
            lines.append(
                "  " * depth + f"v.{match[1]}.run({_expression(match[2])}, {match[3]}, now)"
            )
        else:
            name, value = statement.split(" := ", 1)
            lines.append("  " * depth + f"v.{name} = {_expression(value)}")
    return "\n".join(lines)


def _expression(text: str) -> str:
    def word(found: re.Match[str]) -> str:
        known = {"AND": "and", "OR": "or", "NOT": "not", "TRUE": "True", "FALSE": "False"}
        return known.get(found[0], f"v.{found[0]}")

    text = re.sub(r"(?<![\w.])[A-Za-z]\w*", word, text)
    return re.sub(r"(?<![<>:])=", "==", text)


@dataclass
class Block:
    """The function block's variables, as declared."""

    text: str
    values: dict[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        code = compile(python_of(self.text), "st", "exec")
        kinds = {"BOOL": False, "INT": 0, "LREAL": 0.0}
        declared = re.sub(r"\(\*.*?\*\)", "", self.text, flags=re.DOTALL)
        for name, kind in re.findall(r"^\s+(\w+) : (\w+);", declared, re.MULTILINE):
            setattr(self, name, Ton() if kind == "TON" else kinds[kind])
        self._code = code

    def scan(self, now: float) -> None:
        """One cycle of the PLC."""
        exec(self._code, {"v": self, "now": now})


@pytest.mark.parametrize("kind", ["Robot", "Simulated"])
@pytest.mark.parametrize(
    ("modes", "seconds"),
    [
        ("STAND_ON_BRAKES", 40.0),
        ("BUS_POWER_OFF", 60.0),
        ("STAND_ON_BRAKES>BUS_POWER_OFF", 60.0),
        ("HIBERNATION", 320.0),
        ("STAND_ON_BRAKES>BUS_POWER_OFF>HIBERNATION", 340.0),
    ],
)
def test_the_structured_text_spends_a_pause_as_planned(
    modes: str, seconds: float, kind: str
) -> None:
    """Against a controller that follows the transition times, whatever the text is made from, and
    against the driver's own state machine with its rules of AB and HIB.
    """
    planned = pause(modes, seconds)
    block = Block(structured_text("MAIN", [planned], NUMBERS, ["for a test"]))
    robot = Simulated() if kind == "Simulated" else Robot()
    step = 0.05
    asked_in: list[str] = []
    for k in range(int((seconds + 30.0) / step)):
        now = k * step
        robot.show(block)
        block.scan(now)
        robot.obey(block, step)
        if robot.mode.name not in asked_in:
            asked_in.append(robot.mode.name)
        if robot.over:
            break
    assert robot.over
    assert now == pytest.approx(seconds, abs=1.0)
    assert [one for one in asked_in if one in modes.split(">")] == modes.split(">")
    assert robot.seconds_in[planned.modes[-1]] == pytest.approx(
        planned.wake_at - planned.asked_at[-1] - TIMES.enter(planned.modes[-1]), abs=1.0
    )
    assert not any((block.AB, block.HIB, block.DrivesOff))


class Robot:
    """A controller in EXT that stands in a pause of an exported program, by the times alone."""

    def __init__(self) -> None:
        self.mode = Mode.STAND_ON_MOTORS
        self.goal = Mode.STAND_ON_MOTORS
        self.left = 0.0
        self.asked = 1
        self.over = False
        self.active = True
        self.seconds_in = dict.fromkeys((mode.name for mode in Mode), 0.0)

    @property
    def online(self) -> bool:
        leaving = self.goal is not self.mode and self.goal is Mode.STAND_ON_MOTORS
        return self.mode is not Mode.HIBERNATION or (leaving and self.left < 1.0)

    def show(self, block: Block) -> None:
        """Its outputs as the PLC reads them."""
        ready = self.mode is Mode.STAND_ON_MOTORS and self.goal is self.mode
        block.Enable = True
        block.Online = self.online
        block.Ext = self.online
        block.PauseNumber = self.asked if self.online else 0
        block.DrivesReady = ready
        block.StopMessage = False
        self.active = self.active and ready
        block.ProgramActive = self.active

    def obey(self, block: Block, step: float) -> None:
        """Its inputs, and what time does."""
        if self.goal is not Mode.STAND_ON_MOTORS:
            self.seconds_in[self.mode.name] += step
        self.active = self.active or bool(block.ExtStart)
        if block.PauseDone and self.active:
            self.asked = 0
            self.over = True
        if self.left > 0.0:
            self.left -= step
            self.mode = self.goal if self.left <= 0.0 else self.mode
            return
        deeper = Mode.STAND_ON_MOTORS
        deeper = Mode.STAND_ON_BRAKES if block.DrivesOff else deeper
        deeper = Mode.BUS_POWER_OFF if block.AB else deeper
        deeper = Mode.HIBERNATION if block.HIB else deeper
        wakes = block.SendWakePacket if self.mode is Mode.HIBERNATION else block.DrivesOn
        if deeper > self.mode:
            self.goal = deeper
            self.left = TIMES.enter(deeper.name)
        elif wakes and self.mode is not Mode.STAND_ON_MOTORS:
            self.goal = Mode.STAND_ON_MOTORS
            self.left = TIMES.leave(self.mode.name)


class Simulated(Robot):
    """The modes of the simulated driver, asked for by its PLC inputs."""

    def __init__(self) -> None:
        super().__init__()
        self._plc = Plc(PlcSettings(), Notices(), OperatingMode.EXT)
        self._control = ModeControl(SimulationSettings(), self._plc, lambda _mode: 0.0, {})

    @property
    def online(self) -> bool:
        return self.mode not in (Mode.TO_HIBERNATION, Mode.HIBERNATION, Mode.FROM_HIBERNATION)

    def obey(self, block: Block, step: float) -> None:
        inputs = ("AB", "HIB", "DrivesOff", "DrivesOn", "ConfMess")
        bits = ("ab", "hib", "drives_off", "drives_on", "conf_mess")
        for name, bit in zip(inputs, bits, strict=True):
            self._plc.set_bit(bit, bool(getattr(block, name)))
        self.seconds_in[self.mode.name] += step
        self.active = self.active or bool(block.ExtStart)
        if block.PauseDone and self.active:
            self.asked = 0
            self.over = True
        asleep = not self.online
        self._control.latches.wake = bool(block.SendWakePacket)
        self._plc.step(step)
        self._control.react_to_plc()
        self._control.step(step, motion=False, standing=True, emergency=False)
        self.mode = self._control.modes.mode
        self.goal = self.mode
        if asleep and self.online:
            self._plc.wake()
