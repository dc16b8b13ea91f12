"""Quality of service as recordings carry it: the YAML that rosbag2 writes beside every channel.

rosbag2 (metadata version 9, since Jazzy) names the policies; playback offers again what was
offered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import yaml

MOST_TEXT = 100_000  # characters of a channel's offers: one publisher takes 400
_INFINITE = {"sec": 9223372036, "nsec": 854775807}  # RMW_DURATION_INFINITE


@dataclass(frozen=True)
class QosOffer:
    """What one publisher offered: reliable or best effort, latched (transient local) or not, and
    its depth.
    """

    reliable: bool = True
    transient_local: bool = False
    depth: int = 0  # 0: discovery doesn't carry it


@dataclass(frozen=True)
class QosRequest:
    """What a subscription must ask for to receive from all publishers of a topic."""

    reliable: bool
    transient_local: bool


def request_for(offers: Sequence[QosOffer]) -> QosRequest:
    """The strictest request that all offers meet (as rosbag2 does); without a publisher: reliable,
    not latched.
    """
    if not offers:
        return QosRequest(reliable=True, transient_local=False)
    return QosRequest(all(o.reliable for o in offers), all(o.transient_local for o in offers))


def offers_to_yaml(offers: Sequence[QosOffer]) -> str:
    """The text of a channel's `offered_qos_profiles`."""
    profiles = [
        {
            "history": "keep_last" if offer.depth else "unknown",
            "depth": offer.depth,
            "reliability": "reliable" if offer.reliable else "best_effort",
            "durability": "transient_local" if offer.transient_local else "volatile",
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }
        for offer in offers
    ]
    return str(yaml.safe_dump(profiles, sort_keys=False)) if profiles else ""


def offers_from_yaml(text: str) -> tuple[QosOffer, ...]:
    """Offers of a channel; names (version 9) and numbers (before) are understood, nonsense is no
    offer.
    """
    if len(text) > MOST_TEXT:
        return ()
    try:
        profiles = yaml.safe_load(text) if text else []
    except (yaml.YAMLError, RecursionError):
        return ()
    if not isinstance(profiles, list):
        return ()
    return tuple(
        QosOffer(
            reliable=profile.get("reliability") not in ("best_effort", 2),
            transient_local=profile.get("durability") in ("transient_local", 1),
            depth=profile["depth"] if isinstance(profile.get("depth"), int) else 0,
        )
        for profile in profiles
        if isinstance(profile, dict)
    )
