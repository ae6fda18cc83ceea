# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Route instructions understood without a model: words, clauses, meaning.

`lexer` turns the words of an instruction into lexemes with the help of a vocabulary (one table a
language) and of the map's places, `pieces` splits them where one clause ends and another begins,
and `clauses.lark` says what a clause looks like. What was not read is said, never guessed.
"""
