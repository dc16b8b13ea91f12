"""Quality of service survives the file, and a request meets all offers."""

from __future__ import annotations

from ir_recorder.format.qos import QosOffer, offers_from_yaml, offers_to_yaml, request_for


def test_offered_qualities_survive_the_file_in_names_and_numbers() -> None:
    offers = (QosOffer(reliable=False, depth=7), QosOffer(transient_local=True))
    assert offers_from_yaml(offers_to_yaml(offers)) == offers
    old = "- {history: 1, depth: 3, reliability: 2, durability: 1}"
    assert offers_from_yaml(old) == (QosOffer(reliable=False, transient_local=True, depth=3),)
    assert offers_from_yaml("not: [a list") == ()


def test_a_request_meets_all_offers() -> None:
    mixed = request_for([QosOffer(transient_local=True), QosOffer(reliable=False)])
    assert not mixed.reliable
    assert not mixed.transient_local
    assert request_for([QosOffer(transient_local=True)]).transient_local
    assert request_for([]).reliable
