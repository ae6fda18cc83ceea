"""Service introspection: requests and answers on a topic of their own, to be recorded."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState

from llm_astar_planner.nodes.common.qos import RELIABLE

# The values of the parameter `introspection_mode`.
STATES = {
    'disabled': ServiceIntrospectionState.OFF,
    'metadata': ServiceIntrospectionState.METADATA,
    'contents': ServiceIntrospectionState.CONTENTS,
}


def introspect(node: Node, service: Service, mode: str) -> None:
    """Publish a service's requests and answers on `<service>/_service_event`, as `mode` says."""
    service.configure_introspection(node.get_clock(), RELIABLE, STATES[mode])
