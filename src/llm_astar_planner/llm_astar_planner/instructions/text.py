# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The text of an instruction, and what to do where it cannot be met: what parameters have of it.

Imported with the parameters, so without what takes long to import.
"""

from llm_astar_msgs_adapter.errors import LlmAstarError

MAX_INSTRUCTION_CHARS = 500
PREFER, REQUIRE = 'prefer', 'require'
POLICIES = (PREFER, REQUIRE)


class InstructionError(LlmAstarError, ValueError):
    """An instruction cannot be used; the message says why."""


def clean_instruction(text: str) -> str:
    """Return an instruction as one line: unprintable characters become spaces.

    Raises InstructionError where it is longer than MAX_INSTRUCTION_CHARS.
    """
    if len(text) > MAX_INSTRUCTION_CHARS:
        raise InstructionError(
            f'instruction: {len(text)} characters are more than {MAX_INSTRUCTION_CHARS}'
        )
    printable = ''.join(letter if letter.isprintable() else ' ' for letter in text)
    return ' '.join(printable.split())
