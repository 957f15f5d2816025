"""Plugins, scans and what was found in them, described in words."""

from oatkit.describe.findings import focus_text, motion_text
from oatkit.describe.plugins import ParameterRow, parameter_rows, pipeline_tables, plugin_text, table_text
from oatkit.describe.scans import Beside, look_beside, scan_table, scan_text

__all__ = [
    "Beside", "ParameterRow", "focus_text", "look_beside", "motion_text", "parameter_rows", "pipeline_tables",
    "plugin_text", "scan_table", "scan_text", "table_text",
]  # fmt: skip
