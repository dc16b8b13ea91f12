"""What a URDF does not say, estimated: masses from the volume of the bodies, drives from what they
must hold. Every estimate is said, and marked so in the robot file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ir_description.files.making.link_bodies import LinkBody, box_of, volume_of
from ir_description.files.making.urdf_arm import ArmLink, UrdfArm
from ir_kernels import Chain
from ir_values.arrays import BoolArray, FloatArray, frozen_inertia
from ir_values.errors import InvalidValueError, listed

GRAVITY = 9.80665
DENSITY = 1100.0
"""kg of an arm per m^3 of the hulls of its links, where nothing says its mass: castings are hollow,
hulls are not.
"""
_ALIKE = 3  # links of exactly the same mass are no chance
AGREES = 0.1
"""Share by which masses of a URDF may miss the stated total and are still believed."""
ROUNDING = 0.01
"""Share by which principal moments of few digits may miss the triangle inequality."""
SLIGHT = 0.1
"""Least radius of gyration of a link, as a share of that of a solid of its shape: castings are
hollow, which makes it larger, and no arm has all its mass in the core of its links.
"""
_LEAST = 1e-3  # kg of a link without a body

# Reach [m] and full speeds [deg/s] of the KR 210 R2700 extra: other arms move their flange as fast.
_REACH = 2.96
_SPEEDS = np.array([123.0, 115.0, 112.0, 179.0, 172.0, 219.0])

# Load centre in front of and beside the flange, as shares of the reach: KR 210: 0.24 m.
LOAD_AHEAD = 0.09
LOAD_BESIDE = 0.05
HOLDS = 1.5
"""Peak torque over what holds the rated payload in the worst posture: bundled robots 1.1 to 3.9
without a counterbalance.
"""
_FIRST = 0.8  # peak torque of axis 1 over that of axis 2: bundled robots 0.76 to 1.3
_LAST = 0.6  # of axis 6 over that of axis 5: 0.5 to 1.0
_WEAKEST = 0.01  # of the strongest: an axis that holds nothing has a drive as well
WORTH = (0.7, 20.0)
"""A stated torque is believed where it is between these shares of what holds the payload."""
POSTURES = 2000


def with_masses(
    arm: UrdfArm, bodies: Sequence[Sequence[LinkBody]], total: float | None
) -> tuple[UrdfArm, tuple[str, ...]]:
    """The arm with masses for all links, and sentences on what was estimated.

    total [kg]: of the whole arm with its base, None where it is not known; bodies: of each link.
    Raises InvalidValueError.
    """
    sizes = [volume_of(each) for each in bodies]
    volumes = np.array([volume for volume, _, _ in sizes])
    own = np.array([link.mass for link in arm.links])
    lacking: BoolArray = own <= 0.0
    notes: list[str] = []
    if total is not None and not lacking.any() and abs(own.sum() - total) > AGREES * total:
        notes.append(
            f"the masses of the URDF add up to {own.sum():.4g} kg, the arm weighs {total:g} kg: "
            "its masses and inertias are not taken"
        )
        lacking[:] = True
    if lacking.any():
        density, source = _density(own, volumes, lacking, total)
        estimated = [
            _estimated(link, size, density, source) if lack else link
            for link, size, lack in zip(arm.links, sizes, lacking, strict=True)
        ]
        names = listed(link.name for link, lack in zip(arm.links, lacking, strict=True) if lack)
        notes.append(f"masses of {names}: estimated, {source}")
    else:
        estimated = list(arm.links)
    links = []
    for link, size, own_bodies in zip(estimated, sizes, bodies, strict=True):
        mended, note = _possible(link, size)
        if not note and own_bodies and not link.estimate:
            mended, note = _of_its_size(link, size, own_bodies)
        placed, far = _among(mended, own_bodies)
        links.append(placed)
        notes += [each for each in (note, far) if each]
    if total is None:
        notes += _placeholders(arm.links[1:])
    return replace(arm, links=tuple(links)), tuple(notes)


def _density(
    own: FloatArray, volumes: FloatArray, lacking: BoolArray, total: float | None
) -> tuple[float, str]:
    """kg per m^3 of the links that lack a mass, and where it is from."""
    open_ = float(volumes[lacking].sum())
    known = float(own[~lacking].sum())
    if total is not None:
        if known >= total:
            raise InvalidValueError(
                f"the links with a mass weigh {known:g} kg already, --mass is {total:g} kg: it "
                "must be that of the whole arm with its base"
            )
        if not open_ > 0.0:
            raise InvalidValueError(
                f"{total - known:g} kg of the arm belong to links without a body: give them an "
                "<inertial>"
            )
        return (total - known) / open_, f"{total - known:.4g} kg in proportion to their volume"
    if not lacking.all() and volumes[~lacking].sum() > 0.0:
        density = known / float(volumes[~lacking].sum())
        return density, f"{density:.4g} kg/m^3 as the other links have"
    return DENSITY, f"{DENSITY:g} kg/m^3 of their hulls; --mass KG says the arm's mass"


def _estimated(
    link: ArmLink, size: tuple[float, FloatArray, FloatArray], density: float, source: str
) -> ArmLink:
    volume, centre, inertia = size
    mass = density * volume
    if not mass > _LEAST:
        small = 0.4 * _LEAST * 1e-4 * np.eye(3)
        return replace(link, mass=_LEAST, com=np.zeros(3), inertia=small, estimate="no body")
    return replace(link, mass=mass, com=centre, inertia=density * inertia, estimate=source)


def _possible(link: ArmLink, size: tuple[float, FloatArray, FloatArray]) -> tuple[ArmLink, str]:
    """The link with an inertia that a body can have, and a sentence where it had none."""
    try:
        frozen_inertia(link.inertia, f"inertia of {link.place}")
    except InvalidValueError as error:
        moments, axes = np.linalg.eigh(0.5 * (link.inertia + link.inertia.T))
        missing = moments[2] - moments[0] - moments[1]
        if moments[0] > 0.0 and 0.0 < missing <= ROUNDING * moments[2]:
            raised = moments + np.array([0.5, 0.5, 0.0]) * missing * (1.0 + 1e-6)
            mended = axes @ np.diag(raised) @ axes.T
            more = f"moments of {link.place} miss the triangle inequality by rounding: raised"
            return replace(link, inertia=0.5 * (mended + mended.T)), (
                f"{more} from {moments[0]:.4g} and {moments[1]:.4g} kg m^2 by {0.5 * missing:.2g}"
            )
        volume, _, inertia = size
        if not volume > 0.0:
            raise InvalidValueError(
                f"{error}, and its link has no body to estimate it from: correct its <inertia>"
            ) from error
        solid = link.mass / volume * inertia
        source = "inertia of a solid of its shape"
        return replace(link, inertia=solid, moments=source), f"{error}: taken is the {source}"
    return link, ""


def _of_its_size(
    link: ArmLink, size: tuple[float, FloatArray, FloatArray], bodies: Sequence[LinkBody]
) -> tuple[ArmLink, str]:
    """The link with an inertia that its bodies can have, and a sentence where it had none."""
    volume, _, inertia = size
    if not volume > 0.0:
        return link, ""
    solid = link.mass / volume * inertia
    radius, own = (
        float(np.sqrt(np.linalg.eigvalsh(each)[-1] / link.mass)) for each in (link.inertia, solid)
    )
    low, high = box_of(bodies)
    most = float(np.linalg.norm(high - low))
    if SLIGHT * own <= radius <= most:
        return link, ""
    source = "inertia of a solid of its shape"
    return replace(link, inertia=solid, moments=source), (
        f"{link.place}: its inertia has a radius of gyration of {radius:.3g} m, for bodies of its "
        f"size it must be from {SLIGHT * own:.3g} to {most:.3g} m: taken is the {source}; correct "
        "its <inertia> (kg m^2)"
    )


def _among(link: ArmLink, bodies: Sequence[LinkBody]) -> tuple[ArmLink, str]:
    """The link, doubted where its centre of mass is farther from its bodies than these are large,
    and a sentence on that.
    """
    if not bodies or not link.mass > 0.0:
        return link, ""
    low, high = box_of(bodies)
    beside = float(np.linalg.norm(np.maximum(np.maximum(low - link.com, link.com - high), 0.0)))
    across = float(np.linalg.norm(high - low))
    if beside <= across:
        return link, ""
    return replace(link, doubted=True), (
        f"{link.place}: its centre of mass is {beside:.3g} m beside its bodies, must be at most "
        f"{across:.3g} m, as far as they reach: millimetres? it is taken as it stands and torques "
        "follow from it; correct the <origin> of its <inertial> (m)"
    )


def _placeholders(links: Sequence[ArmLink]) -> list[str]:
    """A sentence where all moving links weigh the same."""
    given = [link for link in links if link.mass > 0.0]
    if len(given) < _ALIKE or len({link.mass for link in given}) > 1:
        return []
    return [
        f"{given[0].place} and all other moving links weigh {given[0].mass:.4g} kg, must differ in "
        "an arm: a placeholder? it is taken as it stands; --mass KG says the arm's mass"
    ]


def holding_torques(arm: UrdfArm, q: FloatArray, payload: float) -> FloatArray:
    """Torques (N, 6) [Nm] that hold an arm with a payload [kg] in postures q (N, 6)."""
    poses = Chain(arm).link_poses(q)
    ahead = arm.reach * np.array([LOAD_AHEAD, 0.0, LOAD_BESIDE])
    bodies = [(k, link.mass, link.com) for k, link in enumerate(arm.links)]
    bodies.append((len(arm.links) - 1, payload, ahead))
    weighed = [
        (k, mass, np.einsum("nij,j->ni", poses[:, k, :3, :3], com) + poses[:, k, :3, 3])
        for k, mass, com in bodies
    ]
    torque = np.zeros((len(q), len(arm.joints)))
    for i in range(len(arm.joints)):
        z = np.einsum("nij,j->ni", poses[:, i + 1, :3, :3], arm.axis[i])
        for k, mass, centre in weighed:
            if k > i:
                arms = np.cross(z, centre - poses[:, i + 1, :3, 3])
                torque[:, i] += GRAVITY * mass * arms[:, 2]
    return torque


def usual_speeds(reach: float) -> FloatArray:
    """Full speeds (6,) [deg/s] of an arm of a reach [m]."""
    return _SPEEDS * min(max(_REACH / reach, 0.5), 4.0)


def peak_torques(
    arm: UrdfArm, low: FloatArray, high: FloatArray, payload: float
) -> tuple[FloatArray, FloatArray]:
    """Peak torques (6,) [Nm] that an arm for this payload [kg] needs, and what holds it at most
    (6,) between low and high (6,) [rad].
    """
    q = np.random.default_rng(0).uniform(low, high, (POSTURES, len(low)))
    held = np.abs(holding_torques(arm, q, payload)).max(axis=0)
    peak = HOLDS * held
    peak[0] = max(peak[0], _FIRST * peak[1])
    peak[3] = max(peak[3], peak[4])
    peak[5] = max(peak[5], _LAST * peak[4])
    return np.maximum(peak, _WEAKEST * float(peak.max())), held
