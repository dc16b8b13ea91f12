"""Seconds of the processor: other processes count while they are charged, and stay counted."""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any

from ir_studies.arena.processor_time import charged, processor_time


def test_a_process_that_is_charged_counts_also_when_it_has_ended(wait_for: Any) -> None:
    busy = subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"])
    own, begin = time.process_time(), processor_time()
    try:
        with charged(busy.pid):
            wait_for(lambda: processor_time() - begin > time.process_time() - own + 0.02, what="it counts")
            during = processor_time()
    finally:
        busy.kill()
        busy.wait()
    assert processor_time() >= during


def test_a_process_that_is_gone_costs_nothing() -> None:
    gone = subprocess.Popen(["true"])
    gone.wait()
    own, begin = time.process_time(), processor_time()
    with charged(gone.pid):
        passed = processor_time() - begin
    assert passed <= time.process_time() - own
