"""The quality of service of each topic, in one place (see the README's tables)."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# As map_server publishes: a late joiner gets the last map.
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# What belongs to a service's answer: kept for a listener who is found a moment late.
REPORTS = QoSProfile(
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
# Parts of a map, each of which counts.
UPDATES = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
