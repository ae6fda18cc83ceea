# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Instructions understood by a language model, and held against the sentence word by word."""
