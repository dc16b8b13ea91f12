"""What makes no sense is refused with a message that names the argument; which build runs is
decided once.
"""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_cases import CAPSULES, KR210, OPEN, SELF_PAIRS, TCP, Body, Capsule, box, shift

from ir_kernels import Chain, CollisionModel, KernelError, compiled

MODEL = CollisionModel(Chain(KR210, tcp=TCP), CAPSULES, OPEN, SELF_PAIRS)
GOOD = np.zeros((4, 6))
NAN = np.full((4, 6), np.nan)
LONG_AXIS: Any = SimpleNamespace(joint_origin=np.eye(4)[None], joint_axis=[[0.0, 0.0, 2.0]])

ON_Q: list[Callable[[Any], object]] = [
    MODEL.distances,
    MODEL.min_distance,
    lambda q: MODEL.is_free(q, 0.0),
    lambda q: MODEL.witnesses(q, np.zeros(4, int)),
    lambda q: MODEL.gradients(q, np.zeros(4, int)),
    MODEL.chain.link_poses,
    MODEL.chain.tcp_poses,
    MODEL.chain.jacobian,
]


@pytest.mark.parametrize("call", ON_Q)
@pytest.mark.parametrize(
    "q",
    [
        pytest.param(np.zeros((4, 5)), id="too few joints"),
        pytest.param(np.zeros(6), id="no batch axis"),
        pytest.param(NAN, id="nan"),
        pytest.param(np.full((4, 6), np.inf), id="inf"),
        pytest.param(np.zeros((0, 6)), id="empty"),
        pytest.param(np.zeros((4, 12))[:, ::2], id="not contiguous"),
        pytest.param(np.array([["a"] * 6] * 4), id="text"),
        pytest.param(np.zeros((4, 6), complex), id="complex"),
        pytest.param([[0.0] * 6, [0.0] * 5], id="ragged"),
    ],
)
def test_bad_configurations_are_refused_by_name(call: Callable[[Any], object], q: Any) -> None:
    with pytest.raises(ValueError, match=r"^q\b"):
        call(q)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: MODEL.certify_edges(NAN, GOOD, 0.0), "q0"),
        (lambda: MODEL.certify_edges(GOOD, NAN, 0.0), "q1"),
        (lambda: MODEL.certify_edges(GOOD, GOOD[:3], 0.0), "q1"),
        (lambda: MODEL.certify_edges(GOOD, GOOD, np.nan), "threshold"),
        (lambda: MODEL.is_free(GOOD, np.zeros(3)), "threshold"),
        (lambda: MODEL.is_free(GOOD, np.inf), "threshold"),
        (lambda: MODEL.min_distance(GOOD, [0.0]), "offset"),
        (lambda: MODEL.witnesses(GOOD, [0, 1]), "pair"),
        (lambda: MODEL.witnesses(GOOD, [0, 1, 2, len(MODEL.pairs)]), "pair"),
        (lambda: MODEL.gradients(GOOD, [0.5, 0.0, 0.0, 0.0]), "pair"),
        (lambda: MODEL.certify_trajectory(np.zeros((2, 5, 6)), [1.0, 1.0], 0.0), "coefficients"),
        (lambda: MODEL.certify_trajectory(np.zeros((2, 6, 6)), [1.0], 0.0), "durations"),
        (lambda: MODEL.certify_trajectory(np.zeros((1, 6, 6)), [-1.0], 0.0), "durations"),
        (lambda: Chain(KR210, base_pose=np.ones((4, 4))), "base_pose"),
        (lambda: Chain(KR210, tcp=np.diag([1.0, 1.0, -1.0, 1.0])), "tcp"),
        (lambda: Chain(LONG_AXIS), "joint_axis"),
    ],
)
def test_other_bad_arguments_are_refused_by_name(call: Callable[[], object], name: str) -> None:
    with pytest.raises(KernelError, match=rf"^{re.escape(name)}\b"):
        call()


def model(**changes: Any) -> CollisionModel:
    parts: dict[str, Any] = {
        "capsules": CAPSULES,
        "bodies": OPEN,
        "self_pairs": SELF_PAIRS,
        **changes,
    }
    return CollisionModel(Chain(KR210), **parts)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"self_pairs": [("t_bar", "nobody")]}, "self_pairs names 'nobody': known are base, l1a"),
        ({"self_pairs": [("l2", "l2")]}, "no distance from itself"),
        ({"ignored_pairs": [("t_bar", "nobody")]}, "ignored_pairs names 'nobody'"),
        ({"capsules": (*CAPSULES, CAPSULES[0])}, "'base' is used more than once"),
        ({"bodies": (*OPEN, OPEN[0])}, "'pallet1' is used more than once"),
        (
            {"capsules": [Capsule("c", 7, np.zeros(3), np.zeros(3), 0.1)], "self_pairs": ()},
            "has links 0 to 6",
        ),
        (
            {"capsules": [Capsule("c", 6, np.zeros(3), np.zeros(3), -0.1)], "self_pairs": ()},
            "radius -0.1 m",
        ),
        ({"bodies": [box("flat", (0, 0, 0), (1.0, 0.0, 1.0))]}, "a box needs 3 positive lengths"),
        ({"bodies": [Body("b", "cone", np.eye(4), np.ones(3))]}, "known kinds are box, cylinder"),
        ({"bodies": [Body("b", "box", shift((np.nan, 0, 0)), np.ones(3))]}, "b'.pose"),
        (
            {"bodies": [Body("b", "mesh", np.eye(4), np.zeros(3), np.zeros((5, 3)))]},
            "no convex hull with a volume",
        ),
        ({"bodies": [Body("b", "mesh", np.eye(4), np.zeros(3))]}, "vertices"),
    ],
)
def test_bad_models_are_refused_with_what_is_wrong(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(KernelError, match=re.escape(words)):
        model(**changes)


def run(code: str, choice: str, *flags: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "IR_KERNELS": choice}
    return subprocess.run(
        [sys.executable, *flags, "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("choice", ["reference", compiled.NAME])
def test_the_build_can_be_chosen(choice: str) -> None:
    done = run("from ir_kernels import compiled; print(compiled.NAME)", choice)
    assert done.stdout.strip() == choice, done.stderr


def test_an_unknown_build_lists_the_known_ones() -> None:
    done = run("import ir_kernels", "fastest")
    assert "known are native, baseline, reference" in done.stderr


def test_without_a_compiled_core_one_warning_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_import", lambda name: None)
    with pytest.warns(RuntimeWarning, match="no compiled core") as warned:
        assert compiled.load() == ("reference", None)
    assert len(warned) == 1


@pytest.mark.parametrize(
    ("runs", "there", "loaded"),
    [
        (True, ("_native", "_baseline"), "native"),
        (True, ("_native",), "native"),
        (True, ("_baseline",), "baseline"),
        (False, ("_native", "_baseline"), "baseline"),
        (None, ("_native", "_baseline"), "baseline"),  # nothing says what the native build needs
    ],
)
def test_native_is_loaded_where_its_instructions_are_there(
    runs: bool | None, there: tuple[str, ...], loaded: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    modules = {name: SimpleNamespace(name=name) for name in there}
    if runs is not None:
        modules["_processor"] = SimpleNamespace(native_runs_here=lambda: runs)
    monkeypatch.setattr(compiled, "_import", modules.get)
    assert compiled.load() == (loaded, modules[f"_{loaded}"])


def test_baseline_and_native_agree(baseline: Any) -> None:
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (37, 6))
    native = MODEL.distances(q)
    own = compiled.MODULE
    try:
        compiled.MODULE = baseline
        other = model(bodies=OPEN)
    finally:
        compiled.MODULE = own
    np.testing.assert_allclose(other.distances(q), native, atol=1e-12)
    np.testing.assert_allclose(
        other.min_distance(q).distance, MODEL.min_distance(q).distance, atol=2e-6
    )
