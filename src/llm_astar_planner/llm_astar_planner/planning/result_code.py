"""What came of a plan, in Nav2's numbers."""

from enum import IntEnum


class ResultCode(IntEnum):
    """Result codes of nav2_msgs/ComputePathToPose, same numbers and meanings."""

    NONE = 0
    UNKNOWN = 200
    INVALID_PLANNER = 201
    TF_ERROR = 202
    START_OUTSIDE_MAP = 203
    GOAL_OUTSIDE_MAP = 204
    START_OCCUPIED = 205
    GOAL_OCCUPIED = 206
    TIMEOUT = 207
    NO_VALID_PATH = 208
