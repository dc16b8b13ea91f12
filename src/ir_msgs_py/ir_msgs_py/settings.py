"""Forwards to ir_values.settings until every package imports that."""

from ir_values.settings import (
    SETTING_TYPES,
    Setting,
    changed,
    check_settings,
    describe,
    setting,
    settings_table,
    stage,
    stages,
    tree,
)

__all__ = [
    "SETTING_TYPES",
    "Setting",
    "changed",
    "check_settings",
    "describe",
    "setting",
    "settings_table",
    "stage",
    "stages",
    "tree",
]
