"""What is measured of a drive, and how pairs of drives are compared."""

import math
from statistics import median

import numpy as np


def length(points):
    """Return the metres along points [n, 2 or more]."""
    steps = np.diff(np.asarray(points, dtype=np.float64)[:, :2], axis=0)
    return float(np.hypot(*steps.T).sum())


def turning(poses):
    """Return the radians by which poses (x, y, yaw) turn, to both sides."""
    steps = np.diff(np.asarray(poses, dtype=np.float64)[:, 2])
    return float(np.abs(np.remainder(steps + math.pi, 2.0 * math.pi) - math.pi).sum())


# What drives share that are compared.
SETTING = ('map', 'scenario', 'seed', 'noise')


def setting_of(row):
    """Return the setting of a drive."""
    return tuple(row.get(name) for name in SETTING)


def pairs(rows, planner, other):
    """Return the drives of two planners that are of the same setting and mission."""
    found = {}
    for row in rows:
        key = setting_of(row), row['mission']
        found.setdefault(key, {})[row['planner']] = row
    both = (drives for drives in found.values() if planner in drives and other in drives)
    return [(drives[planner], drives[other]) for drives in both]


def median_ratio(both, name):
    """Return the median over pairs that arrived of what one has over the other; None of none."""
    ratios = [
        one[name] / other[name]
        for one, other in both
        if one['arrived'] and other['arrived'] and one[name] is not None and other[name]
    ]
    return median(ratios) if ratios else None


def total(rows, name):
    return sum(row[name] for row in rows)
