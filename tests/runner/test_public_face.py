"""What users of the program runner may import."""

from __future__ import annotations

import ir_program_runner


def test_the_public_face_is_sorted_and_there() -> None:
    assert ir_program_runner.__all__ == sorted(ir_program_runner.__all__)
    assert all(hasattr(ir_program_runner, name) for name in ir_program_runner.__all__)
    assert {"Program", "ProgramSettings", "Fulfilment", "Ports", "DriverPort"} <= set(
        ir_program_runner.__all__
    )
