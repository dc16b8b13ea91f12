"""`ir robot new`: a robot file from a URDF and a sheet of drive figures."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from ir_description import DescriptionError, InvalidValueError, RobotFileError
from ir_description.files import read_regular_file, text_of
from ir_description.files.making import DriveSheet, UrdfArm, drive_sheet, robot_text, urdf_arm
from ir_description.files.making.robot_text import link_names

from ..errors import CommandError, InputError
from .robot_shapes import Shapes, capsules_of, touching_pairs

BYTES_MAX = 8_000_000


def write_robot(urdf: Path, drives: Path, tip: str, packages: Path | None, out: Path) -> None:
    """Write the robot file, and say how well its capsules fit. Raises CommandError."""
    try:
        arm = urdf_arm(_text(urdf), str(urdf), tip)
        sheet = drive_sheet(_text(drives), str(drives), arm)
    except (DescriptionError, InvalidValueError) as error:
        raise InputError(str(error)) from error
    shapes = capsules_of(arm, sheet, link_names(arm, sheet), packages or urdf.parent)
    low, high = (np.radians(sheet.values[f"position_{end}_deg"].numbers) for end in ("min", "max"))
    pairs = touching_pairs(arm, shapes.capsules, low, high)
    try:
        out.write_text(
            robot_text(arm, sheet, shapes.capsules, pairs, _comments(urdf, drives, shapes)), "utf-8"
        )
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror}") from error
    _say(out, arm, sheet, shapes, len(pairs))


def _comments(urdf: Path, drives: Path, shapes: Shapes) -> list[str]:
    return [
        f"Written from {urdf.name} and {drives.name}. Frames: parallel to the base at q = 0, the "
        "last at the",
        "flange with x out. Capsules, and how far they stand out from what they enclose:",
        *(f"  {sentence}" for sentence in shapes.sentences),
    ]


def _say(out: Path, arm: UrdfArm, sheet: DriveSheet, shapes: Shapes, pairs: int) -> None:
    guessed = sorted(key for key, value in sheet.values.items() if value.confidence == "L")
    sys.stdout.write("\n".join(shapes.sentences) + "\n")
    sys.stdout.write(f"{pairs} pairs of capsules can touch\n")
    if guessed:
        sys.stdout.write(f"estimated: {', '.join(guessed)}\n")
    sys.stdout.write(
        f"{out}: robot {sheet.name} of {len(arm.joints)} axes; next: ir robot check {out}\n"
    )


def _text(path: Path) -> str:
    return text_of(read_regular_file(path, BYTES_MAX), str(path), RobotFileError)
