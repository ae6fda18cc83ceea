"""Plan reports and exchanges with a model as diagnostic_msgs/DiagnosticArray, both ways.

Every value is JSON, so that numbers and lists survive the round trip.
"""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from llm_astar_msgs_adapter.messages.report import (
    ExchangeReport,
    PlanReport,
    Report,
    ReportError,
    report_from_values,
)

__all__ = [
    'ExchangeReport',
    'PlanReport',
    'Report',
    'ReportError',
    'report_from_message',
    'report_to_message',
    'status_to_message',
    'status_values',
]


def report_to_message(
    report: PlanReport | ExchangeReport, name: str, stamp: Time
) -> DiagnosticArray:
    """Write a report as one status with a key per field; `name` is the node's."""
    return status_to_message(name, report.level, report.summary, asdict(report), stamp)


def status_to_message(
    name: str, level: bytes, message: str, values: dict[str, Any], stamp: Time
) -> DiagnosticArray:
    """Write one diagnostic status with JSON values."""
    status = DiagnosticStatus(
        name=name,
        level=level,
        message=message,
        values=[KeyValue(key=key, value=json.dumps(value)) for key, value in values.items()],
    )
    array = DiagnosticArray(status=[status])
    array.header.stamp = stamp
    return array


def report_from_message(message: DiagnosticArray, kind: type[Report]) -> Report:
    """Read a PlanReport or an ExchangeReport back.

    Raises ReportError where a field without a default is missing or a value is not JSON.
    """
    if len(message.status) != 1:
        raise ReportError(f'{kind.__name__}: {len(message.status)} statuses, not one')
    names = {field.name for field in fields(kind)}
    values: dict[str, Any] = {}
    for item in message.status[0].values:
        if item.key not in names:
            continue
        try:
            values[item.key] = json.loads(item.value)
        except ValueError:
            raise ReportError(f'{kind.__name__}: {item.key}: is not JSON') from None
    return report_from_values(kind, values)


def status_values(status: DiagnosticStatus) -> dict[str, Any]:
    """Read the values of a diagnostic status by key; a value that is not JSON stays text."""
    return {item.key: json_or_text(item.value) for item in status.values}


def json_or_text(text: str) -> Any:  # noqa: ANN401 - any JSON value
    """Return the JSON value of a text, or the text itself where it is not JSON."""
    try:
        return json.loads(text)
    except ValueError:
        return text
