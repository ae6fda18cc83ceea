# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The quality of service of each topic, in one place (see docs/reference.md)."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# As map_server publishes: a subscriber that joins late gets the last map.
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
# As LATCHED, of several publishers: the last message of each.
LATCHED_BY_MANY = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
# Reports that belong to a service's response: a client that is discovered late gets them too.
REPORTS = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
# For who waits for the reports of many calls at once, of which none may be lost.
REPORTS_OF_CALLS = QoSProfile(
    depth=256, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
# Map updates: none may be lost, since each changes another part of the map.
UPDATES = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
# Requests that wait until a thread is free, and their answers: with the default of 10, those of
# many callers at once would be lost, on both sides: a client's queue also holds the responses to
# all other clients until it has looked at them.
CALLS = QoSProfile(depth=4096, reliability=ReliabilityPolicy.RELIABLE)
# Heartbeats of a bond as bondcpp sends and takes them, those of all other nodes included.
BOND_HEARTBEATS = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)
BOND = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
