"""Names of nodes and namespaces that a user gives."""

from __future__ import annotations

from llm_astar_msgs_adapter.errors import LlmAstarError
from rclpy.exceptions import InvalidNamespaceException, InvalidTopicNameException
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_topic_name import validate_topic_name


class NodeNameError(LlmAstarError, ValueError):
    """A namespace or a node name that ROS does not allow."""


def check_names(namespace: str, *nodes: str) -> str:
    """Return a namespace with its leading slash. Raises NodeNameError for a name ROS forbids."""
    namespace = f'/{namespace.strip("/")}'
    try:
        validate_namespace(namespace)
        for name in nodes:
            validate_topic_name(name)
    except (InvalidNamespaceException, InvalidTopicNameException) as error:
        raise NodeNameError(' '.join(str(error).split())) from None
    return namespace
