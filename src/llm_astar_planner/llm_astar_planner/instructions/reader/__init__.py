# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Instructions in free words, read by a small model of our own and claimed only when sure.

`lifting` puts slots in for what the map and numbers say, `network` writes the `meaning` of the
lifted sentence, `claims` tells whether it is certain, `interpreter` makes clauses of it.
"""
