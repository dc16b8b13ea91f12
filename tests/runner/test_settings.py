"""Settings name what is wrong."""

from __future__ import annotations

import pytest

from ir_program_runner.settings import LinkSettings, ProgramSettings
from ir_values.errors import InvalidValueError


def test_settings_name_what_is_wrong():
    with pytest.raises(InvalidValueError, match=r"ready_timeout is -1 s: it must be 0 \.\. 3600 s"):
        ProgramSettings(ready_timeout=-1.0)
    with pytest.raises(ValueError, match="mac is '12': it must be six hex bytes"):
        LinkSettings(mac="12")
