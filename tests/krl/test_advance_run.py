"""The advance run: which corners are rounded, how far, and what a controller has set before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ir_krl import Followed, Motion, follow, parse
from ir_krl.run import AdvanceStop, Blend
from ir_planner import Planner
from ir_planner.krl.execution import DrivenStep, drive

Follow = Callable[..., Followed]
HEAD = "BAS(#INITMOV,0)\nPTP XHOME\n"
OPEN = "\nEND\nDEF OPEN( )\n$OUT[1]=TRUE\n$OUT[2]=FALSE\nWAIT SEC 1\nIF $IN[9] THEN\nENDIF"
FORM = "PP1={VEL 100.0,ACC 100.0,APO_DIST 50.0,APO_MODE #CDIS}\n"
# what stands between two motions, and whether the advance run stops at it
BETWEEN = {
    "": False,
    "WAIT SEC 0": True,
    "WAIT SEC -1": True,
    "HALT": True,
    "IF $IN[3] THEN\nENDIF": True,
    "IF $OUT[3] THEN\nENDIF": True,
    "SWITCH G\nDEFAULT\nENDSWITCH": True,
    "B=$IN[4]": True,
    "CONTINUE\nB=$IN[4]": False,
    "CONTINUE\nIF $IN[3] THEN\nENDIF": False,
    "CONTINUE\nWAIT FOR $IN[3]": False,
    "CONTINUE\n$OUT[7]=TRUE": False,
    "$OUT_C[7]=TRUE": False,
    "$ANOUT[1]=0.5": True,
    "ANOUT OFF A": True,
    "CONTINUE\n$ANOUT[1]=0.5": False,
    "IF $PRO_ACT THEN\nENDIF": True,
    "$OUT[7]=TRUE": True,
    "PULSE($OUT[7],TRUE,0.1)": True,
    "WAIT FOR $IN[3]": True,
    "$ADVANCE=0": True,
    "NOBODY()": True,
    "CWRITE(H,S,M,1)": True,
    "COPEN(:SER_3,H)": True,
    "N=N+1": False,
    "$VEL.CP=0.4": False,
    "$FLAG[2]=TRUE": False,
    "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[7]=TRUE": False,
    "TRIGGER WHEN PATH=-50 DELAY=0 DO OPEN( ) PRIO=-1": False,
    "HERE=$POS_ACT": True,
}


def moving(planner: Planner, program: Followed) -> list[DrivenStep]:
    steps, _ = drive(program, planner.scene("none"), planner.cell.machine_home)
    return [step for step in steps if step.moves]


@pytest.mark.sampled
@pytest.mark.parametrize("between", BETWEEN)
def test_what_stops_the_advance_run_rounds_no_corner(
    between: str, planner: Planner, followed: Follow
) -> None:
    """Law: motions are one movement exactly where nothing between them stops the advance run."""
    lines = (
        f"DECL INT N\nDECL BOOL B\nSIGNAL G $IN[11] TO $IN[12]\nN=0\n{HEAD}$APO.CPTP=100\n"
        f"PTP {{A1 10,A5 30}} C_PTP\n{between}\nPTP {{A1 20,A2 -80}}{OPEN}"
    )
    found = moving(planner, followed(lines))
    assert len(found) == 1 + BETWEEN[between]
    exact = moving(planner, followed(lines.replace(" C_PTP", "")))
    total, still = (sum(step.trajectory.duration for step in one) for one in (found, exact))
    assert total < still or (BETWEEN[between] and total >= still)


def test_chains_stop_where_an_independent_count_says(planner: Planner, followed: Follow) -> None:
    """Law, on generated chains: a movement ends after each motion without a word, and where the
    advance run stops.
    """
    chance = np.random.default_rng(5)
    kinds = [one for one in BETWEEN if one not in ("$ADVANCE=0", "HERE=$POS_ACT")]
    for _ in range(6):
        lines = [HEAD, "N=0\nSIGNAL G $IN[11] TO $IN[12]"]
        expected = 0
        for k in range(5):
            word = chance.choice(["", " C_PTP", " C_DIS"])
            between = str(chance.choice(kinds))
            lines += [f"PTP {{A1 {7 * k - 15},A3 {90 + 9 * (k % 3)}}}{word}", between]
            expected += not word or BETWEEN[between] or k == 4
        found = moving(
            planner, followed("$APO.CDIS=40\n".join([lines[0], "\n".join(lines[1:]) + OPEN]))
        )
        assert len(found) == expected, lines


def blend_of(program: Followed, name: str = "") -> Blend | None:
    motions = [one for one in program.commands if isinstance(one, Motion)]
    return motions[1 if not name else -1].blend


@pytest.mark.parametrize(
    ("motion", "distance", "share"),
    [
        ("PTP {A1 20} C_PTP", np.inf, 0.5),
        ("PTP {A1 20} C_DIS", 3e-3, 1.0),
        ("PDAT_ACT=PP1\nBAS(#PTP_PARAMS,100)\nPTP {A1 20} C_DIS", 50e-3, 1.0),
        ("PDAT_ACT=PP1\nBAS(#PTP_DAT)\nPTP {A1 20} C_DIS", 50e-3, 1.0),
        ("SPTP {A1 20} WITH $APO=SAPO_PTP(PP1) C_SPL", 50e-3, 1.0),
        ("SPTP {A1 20} C_SPL", 3e-3, 0.5),
        ("$APO.CDIS=7\nPTP {A1 20} C_DIS", 7e-3, 1.0),
        ("$APO.CDIS=0\nLIN_REL {Y 30} C_DIS", 0.0, 1.0),
        ("DEF_APO_CDIS=9\nBAS(#INITMOV,0)\nPTP {A1 20} C_DIS", 9e-3, 1.0),
    ],
)
def test_a_blend_is_as_far_as_the_controllers_data_say(
    motion: str, distance: float, share: float, followed: Follow
) -> None:
    blend = blend_of(followed(f"{FORM}{HEAD}{motion}\nPTP {{A1 0}}"))
    assert blend is not None
    assert (blend.distance, blend.share) == pytest.approx((distance, share))


def test_what_follows_an_axis_motion_along_a_path_blends_by_its_distance(followed: Follow) -> None:
    blend = blend_of(followed(f"{HEAD}PTP {{A1 20}} C_PTP\nLIN_REL {{Z -50}}"))
    assert blend is not None
    assert blend.onto is not None
    assert blend.onto.distance == pytest.approx(3e-3)


@pytest.mark.parametrize("first", ["PTP {A1 20} C_DIS", "LIN_REL {Y 300} C_DIS"])
def test_the_tool_leaves_its_path_within_the_distance(
    first: str, planner: Planner, followed: Follow
) -> None:
    """Law: a longer distance takes no more time; 0 mm is an exact stop; the corner is cut by no
    more than the distance.
    """
    seconds = []
    second = "PTP {A2 -70}" if first.startswith("PTP") else "LIN_REL {Z -300}"
    for distance in (0, 5, 20, 80):
        lines = f"{HEAD}PTP {{A5 45}}\n$VEL.CP=0.5\n$APO.CDIS={distance}\n{first}\n{second}"
        program = followed(lines)
        steps = moving(planner, program)[1:]
        seconds.append(sum(step.trajectory.duration for step in steps))
        assert len(steps) == (2 if distance == 0 else 1)
        exact = moving(planner, followed(lines.replace(" C_DIS", "")))[1]
        corner = planner.scene("none").chain.tcp_poses(exact.trajectory.positions[-1:])[0, :3, 3]
        times = np.linspace(0.0, steps[0].trajectory.duration, 4001)
        tcp = planner.scene("none").chain.tcp_poses(steps[0].trajectory.sample(times).q)
        missed = np.linalg.norm(tcp[:, :3, 3] - corner, axis=1).min()
        assert missed <= 1e-3 * distance + 1e-4
    assert seconds == sorted(seconds, reverse=True)


def test_initmov_is_what_a_controller_does(followed: Follow) -> None:
    lines = (
        "TOOL_DATA[1]={X 0,Y 0,Z 200,A 0,B 0,C 0}\n$TOOL={X 0,Y 0,Z 500,A 0,B 0,C 0}\n"
        f"$BASE={{X 400,Y 0,Z 0,A 0,B 0,C 0}}\n$ADVANCE=0\n{HEAD}"
        "PTP {X 1200,Y 300,Z 900,A 0,B 90,C 0} C_PTP"
    )
    *_, motion = followed(lines).commands
    assert isinstance(motion, Motion)
    assert motion.target.base[:3, 3] == pytest.approx(0.0)
    assert motion.target.tool[:3, 3] == pytest.approx([0.0, 0.0, 0.2])
    assert motion.blend is not None  # $ADVANCE is 3 again


def test_the_axis_data_of_a_form_count_with_its_modes(followed: Follow) -> None:
    """BAS(#PTP_DAT) and BAS(#CP_DAT) of older forms were without effect."""
    lines = (
        f"{HEAD}PDAT_ACT={{VEL 40,ACC 30,APO_DIST 20}}\nBAS(#PTP_DAT)\nPTP {{A1 5}} C_PTP\n"
        "LDAT_ACT={VEL 0.3,ACC 50,APO_DIST 12,ORI_TYP #CONSTANT}\nBAS(#CP_DAT)\nLIN_REL {X 1} C_DIS"
    )
    _, ptp, lin = followed(lines).commands
    assert isinstance(ptp, Motion)
    assert isinstance(lin, Motion)
    assert ptp.blend is not None
    assert lin.blend is not None
    assert (ptp.speeds.axis_velocity[0], ptp.speeds.axis_acceleration[0]) == (0.4, 0.3)
    assert ptp.blend.share == pytest.approx(0.2)
    assert (lin.speeds.velocity, lin.blend.distance) == pytest.approx((0.3, 12e-3))
    assert lin.keeps_orientation


def test_a_load_of_a_tool_is_carried_where_a_form_names_it(followed: Follow) -> None:
    lines = (
        "LOAD_DATA[3]={M 50,CM {X 0,Y 0,Z 100,A 0,B 0,C 0},J {X 1,Y 1,Z 1}}\n"
        f"{HEAD}FDAT_ACT={{TOOL_NO 3,BASE_NO 0,IPO_FRAME #BASE}}\nBAS(#PTP_PARAMS,100)\n"
        "PTP {A1 5}\nSPTP {A1 9} WITH $LOAD=SLOAD(4)"
    )
    _, loaded, unknown = followed(lines).commands
    assert isinstance(loaded, Motion)
    assert isinstance(unknown, Motion)
    assert loaded.payload is not None
    assert unknown.payload is not None
    assert loaded.payload.mass == 50.0
    assert unknown.payload.mass < 0.0  # as the machine data have it


def test_a_stop_is_said_where_it_is(followed: Follow) -> None:
    program = followed(f"{HEAD}PTP {{A1 9}} C_PTP\nWAIT SEC 0\nPTP {{A1 0}}")
    stop = next(one for one in program.commands if isinstance(one, AdvanceStop))
    assert (stop.why, stop.place.line) == ("WAIT SEC 0", 5)
    said = "WAIT SEC 0 stops the advance run: the motion before ends at rest"
    assert said in [note.text for note in program.notes]


def test_the_tool_of_a_program_is_what_the_distance_is_of(planner: Planner) -> None:
    """A longer tool leaves the corner sooner: less of the motions is blended."""
    seconds = []
    for length in (0, 400):
        text = (
            f"DEF T( )\n$TOOL={{X 0,Y 0,Z {length},A 0,B 0,C 0}}\nPTP XHOME\n$APO.CDIS=60\n"
            "PTP {A5 60} C_DIS\nPTP {A5 60,A4 60}\nEND\n"
        )
        program = follow([parse(text, "t.src")], planner.cell.machine_home, np.eye(4))
        seconds.append(sum(one.trajectory.duration for one in moving(planner, program)))
        still = [
            replace(one, blend=None) if isinstance(one, Motion) else one for one in program.commands
        ]
        exact = moving(planner, replace(program, commands=tuple(still)))
        assert seconds[-1] < sum(one.trajectory.duration for one in exact)
    assert seconds[0] < seconds[1]


@pytest.mark.parametrize(
    ("between", "said"),
    [("", True), ("WAIT SEC 0\n", False), ("$ADVANCE=0\nPTP {A1 3}\n", False)],
)
@pytest.mark.parametrize("setting", ["$OV_PRO=50", "BAS(#OV_PRO,50)"])
def test_an_override_that_the_advance_run_sets_over_motions_is_said(
    followed: Follow, between: str, said: bool, setting: str
) -> None:
    """$OV_PRO acts when it is set, on a motion that is still driven as well."""
    notes = followed(f"PTP {{A1 0}}\n{between}{setting}\nPTP {{A1 5}}").notes
    assert any("acts at once, on motions before" in note.text for note in notes) is said
