"""Traffic actions."""

from __future__ import annotations

from runner.registry import action

for name in ("TrafficSourceAction", "TrafficSinkAction", "TrafficSwarmAction", "TrafficAreaAction", "TrafficStopAction"):
    action.refuse(name, "not executed yet")
