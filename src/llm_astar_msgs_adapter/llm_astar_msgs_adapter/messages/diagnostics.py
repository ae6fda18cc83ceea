"""Plan reports and exchanges with a model as diagnostic_msgs/DiagnosticArray, both ways.

Every value is JSON, so that numbers and lists come back as they went.
"""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import Any, TypeVar

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from llm_astar_msgs_adapter.messages.report import ExchangeReport, PlanReport

__all__ = [
    'ExchangeReport',
    'PlanReport',
    'ReportError',
    'report_from_message',
    'report_to_message',
    'status_to_message',
    'status_values',
]

Value = TypeVar('Value', PlanReport, ExchangeReport)


class ReportError(ValueError):
    """A diagnostic message that is no report of the kind asked for."""


def report_to_message(
    report: PlanReport | ExchangeReport, name: str, stamp: Time
) -> DiagnosticArray:
    """Write a report as one status, a key a field; `name` is the node's."""
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


def report_from_message(message: DiagnosticArray, kind: type[Value]) -> Value:
    """Read a PlanReport or an ExchangeReport back.

    Raises ReportError where a field is missing or is not JSON.
    """
    if len(message.status) != 1:
        raise ReportError(f'{kind.__name__}: {len(message.status)} statuses, not one')
    texts = {value.key: value.value for value in message.status[0].values}
    values: dict[str, Any] = {}
    for field in fields(kind):
        if field.name not in texts:
            raise ReportError(f'{kind.__name__}: {field.name}: is missing')
        try:
            values[field.name] = _frozen(json.loads(texts[field.name]))
        except ValueError:
            raise ReportError(f'{kind.__name__}: {field.name}: is not JSON') from None
    return kind(**values)


def status_values(status: DiagnosticStatus) -> dict[str, Any]:
    """Read the values of a diagnostic status by key; the plain text of other nodes stays text."""
    return {value.key: _from_json(value.value) for value in status.values}


def _from_json(text: str) -> Any:  # noqa: ANN401 - any JSON value
    try:
        return json.loads(text)
    except ValueError:
        return text


def _frozen(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Turn JSON's lists into tuples, as the reports hold them."""
    return tuple(_frozen(item) for item in value) if isinstance(value, list) else value
