"""Paths looked at point by point, and how deep points lie in plain shapes: nothing but numpy."""

import math
from itertools import pairwise

import numpy as np

STEP = 0.01


def dense(points):
    """Points at most STEP apart, all corners among them, and the metres along the path."""
    points = np.asarray(points, float)
    parts = [points[:1]]
    for begin, end in pairwise(points):
        count = max(1, math.ceil(math.dist(begin, end) / STEP))
        parts.append(begin + (end - begin) * (np.arange(1, count + 1) / count)[:, None])
    xy = np.concatenate(parts)
    return xy, np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))))


def length_where(deep, at):
    """Metres of a path between neighbouring points that are both deeper than 0."""
    return float(((deep[1:] > 0.0) & (deep[:-1] > 0.0)) @ np.diff(at))


def box_depth(xy, x0, y0, x1, y1):
    """How deep points lie in a box; below 0 how far they are from it."""
    x, y = xy.T
    inside = np.minimum.reduce([x - x0, x1 - x, y - y0, y1 - y])
    beside = np.maximum.reduce([x0 - x, 0.0 * x, x - x1])
    above = np.maximum.reduce([y0 - y, 0.0 * y, y - y1])
    return np.where(inside >= 0.0, inside, -np.hypot(beside, above))


def disc_depth(xy, x, y, radius):
    """How deep points lie in a disc; below 0 how far they are from it."""
    return radius - np.hypot(xy[:, 0] - x, xy[:, 1] - y)


def triangle_depth(xy, corners):
    """How deep points lie in a triangle whose corners turn left; below 0 outside."""
    sides = []
    for one, other in pairwise([*corners, corners[0]]):
        along = np.subtract(other, one) / math.dist(one, other)
        off = xy - one
        sides.append(along[0] * off[:, 1] - along[1] * off[:, 0])
    return np.minimum.reduce(sides)
