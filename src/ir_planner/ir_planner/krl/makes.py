"""Makes of controllers: how a program's parts are written for one, and what its text asks for."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from ir_description import RobotModel
from ir_krl import Followed, follow, parse
from ir_krl.urscript import JointLimits, follow_urscript, written_urscript
from ir_krl.write import PLC_THERE, Attached, Numbers, Style, Texts, WrittenStatement, written
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

Header = Callable[[Texts], Sequence[str]] | Sequence[str]


class Make(Protocol):
    """One make: texts from parts, and the commands that texts ask for."""

    def written(
        self,
        name: str,
        start: FloatArray,
        parts: Sequence[WrittenStatement],
        attached: Attached,
        header: Header,
        *,
        from_home: bool,
        numbers: Numbers,
    ) -> Texts:
        """Texts of a program from `start` (n,) [rad]. Raises KrlError for what it hasn't."""

    def followed(self, texts: Texts, scene: PlanningScene) -> Followed:
        """What the texts ask for. Raises KrlError."""


class Kuka:
    """KRL, in one of its styles."""

    def __init__(self, style: Style) -> None:
        self._style: Style = style

    def written(
        self,
        name: str,
        start: FloatArray,
        parts: Sequence[WrittenStatement],
        attached: Attached,
        header: Header,
        *,
        from_home: bool,
        numbers: Numbers,
    ) -> Texts:
        """NAME.src and NAME.dat."""
        return written(
            name,
            start,
            parts,
            attached,
            header,
            from_home=from_home,
            numbers=numbers,
            style=self._style,
        )

    def followed(self, texts: Texts, scene: PlanningScene) -> Followed:
        """The program without its PLC."""
        sources = [parse(texts.source, "export.src"), parse(texts.data, "export.dat")]
        inputs = {texts.numbers[PLC_THERE]: False} if texts.numbers else {}
        return follow(sources, np.zeros(scene.cell.robot.n), np.eye(4), inputs=inputs)


class Ur:
    """URScript."""

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits

    def written(
        self,
        name: str,
        start: FloatArray,
        parts: Sequence[WrittenStatement],
        attached: Attached,
        header: Header,
        *,
        from_home: bool,
        numbers: Numbers,
    ) -> Texts:
        """NAME.script."""
        return written_urscript(name, start, parts, attached, header, self._limits, numbers)

    def followed(self, texts: Texts, scene: PlanningScene) -> Followed:
        """The script."""
        return follow_urscript(texts.source, "export.script", np.eye(4), self._limits)


_MAKERS: dict[str, str] = {"KUKA": "KRL", "Universal Robots": "URScript"}


def make_remark(style: Style, robot: RobotModel) -> str:
    """A sentence where a program is written in the language of another maker's controller than the
    robot's; "" where it isn't, or nobody knows whose the robot is.
    """
    language = "URScript" if style == "urscript" else "KRL"
    own = next((_MAKERS[maker] for maker in _MAKERS if robot.title.startswith(maker)), language)
    if own == language:
        return ""
    return f"the cell's robot is a {robot.title}, whose controller takes {own}, not {language}"


def joint_limits(scene: PlanningScene) -> JointLimits:
    """What speeds and accelerations of the robot's axes are shares of."""
    return JointLimits(scene.limits.velocity, scene.limits.acceleration)


def make_of(style: Style, scene: PlanningScene) -> Make:
    """The make that a style is of."""
    return Ur(joint_limits(scene)) if style == "urscript" else Kuka(style)
