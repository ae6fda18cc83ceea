"""The control nodes of Nav2's behaviour trees, without ROS.

Written after nav2_behavior_tree and BehaviorTree.CPP (branch jazzy): which child is ticked when,
what is halted, and what each answers.
"""

import time
from enum import Enum, auto


class Status(Enum):
    IDLE = auto()
    RUNNING = auto()
    SUCCESS = auto()
    FAILURE = auto()


IDLE, RUNNING, SUCCESS, FAILURE = Status


class TreeError(RuntimeError):
    """What ends the whole tree, as an exception does in Nav2."""


class TreeNode:
    """A node of the tree; `children` are ticked as its kind says."""

    def __init__(self, *children):
        self.children = children
        self.status = IDLE

    def execute_tick(self):
        self.status = self.tick()
        return self.status

    def tick(self):
        raise NotImplementedError

    def halt(self):
        """Stop what is running; a node that has ended is made ready to be ticked again."""
        for child in self.children:
            if child.status is RUNNING:
                child.halt()
            child.status = IDLE
        self.status = IDLE


class Sequence(TreeNode):
    """Ticks its children in order, from the one that was running."""

    ends_with = FAILURE

    def __init__(self, *children):
        super().__init__(*children)
        self._index = 0

    def tick(self):
        while self._index < len(self.children):
            status = self.children[self._index].execute_tick()
            if status is RUNNING:
                return status
            if status is self.ends_with:
                self.halt()
                return status
            self._index += 1
        self.halt()
        return SUCCESS if self.ends_with is FAILURE else FAILURE

    def halt(self):
        self._index = 0
        super().halt()


class Fallback(Sequence):
    """Ticks its children in order until one succeeds."""

    ends_with = SUCCESS


class ReactiveSequence(TreeNode):
    """Ticks its children from the first on, each time, until one does not succeed."""

    goes_on_with = SUCCESS

    def tick(self):
        for child in self.children:
            status = child.execute_tick()
            if status is not self.goes_on_with:
                if status is not RUNNING:
                    self.halt()
                return status
        self.halt()
        return self.goes_on_with


class ReactiveFallback(ReactiveSequence):
    """Ticks its children from the first on, each time, until one does not fail."""

    goes_on_with = FAILURE


class RecoveryNode(TreeNode):
    """Ticks the first child; where that fails, the second and then the first again."""

    def __init__(self, retries, action, recovery):
        super().__init__(action, recovery)
        self._retries = retries
        self._count = self._index = 0

    def tick(self):
        while self._count <= self._retries:
            status = self.children[self._index].execute_tick()
            if status is RUNNING:
                return RUNNING
            if self._index == 0:
                if status is SUCCESS or self._count == self._retries:
                    break
                self._index = 1
            else:
                if status is FAILURE:
                    break
                self._count += 1
                self._index = 0
            super().halt()
        self.halt()
        return status

    def halt(self):
        self._count = self._index = 0
        super().halt()


class PipelineSequence(TreeNode):
    """Ticks those before the running one again: a new path is planned while one is followed."""

    def __init__(self, *children):
        super().__init__(*children)
        self._last = 0

    def tick(self):
        for index, child in enumerate(self.children):
            status = child.execute_tick()
            if status is FAILURE:
                self.halt()
                return FAILURE
            if status is RUNNING and index >= self._last:
                self._last = index
                return RUNNING
        self.halt()
        return SUCCESS

    def halt(self):
        self._last = 0
        super().halt()


class RoundRobin(TreeNode):
    """Ticks one child after the other, the next one each time."""

    def __init__(self, *children):
        super().__init__(*children)
        self._index = self._failed = 0

    def tick(self):
        while self._failed < len(self.children):
            status = self.children[self._index].execute_tick()
            if status is RUNNING:
                return RUNNING
            self._index = (self._index + 1) % len(self.children)
            if status is SUCCESS:
                self._failed = 0
                super().halt()
                return SUCCESS
            self._failed += 1
        self.halt()
        return FAILURE

    def halt(self):
        self._index = self._failed = 0
        super().halt()


class RateController(TreeNode):
    """Ticks its child at most `hz` times a second, and while it is running."""

    def __init__(self, hz, child):
        super().__init__(child)
        self._period, self._begin, self._is_first = 1.0 / hz, 0.0, False

    def tick(self):
        if self.status is IDLE:
            self._begin, self._is_first = time.monotonic(), True
        child = self.children[0]
        is_due = time.monotonic() - self._begin >= self._period
        if not (self._is_first or child.status is RUNNING or is_due):
            return RUNNING
        self._is_first = False
        status = child.execute_tick()
        if status is SUCCESS:
            self._begin = time.monotonic()
        return status
