# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The kinds of clauses, a module each: values, JSON, words, what it asks of the search, drawing.

A new kind is a module here, its check in `verification` under the same name, and its words.
"""
