"""What a node does to keep its memory from growing."""

import subprocess
import sys

# Prints how many heaps there are after threads that run at once have taken memory of each.
MANY_THREADS = """
import ctypes, tempfile, threading
from llm_astar_planner.nodes.common import process
{begin}
libc, together = ctypes.CDLL(None), threading.Barrier(12)
libc.malloc.restype, libc.free.argtypes = ctypes.c_void_p, (ctypes.c_void_p,)
libc.fopen.restype = ctypes.c_void_p
libc.malloc_info.argtypes = ctypes.c_int, ctypes.c_void_p
libc.fclose.argtypes = (ctypes.c_void_p,)
def take():
    together.wait()
    taken = libc.malloc(1000)
    together.wait()
    libc.free(taken)
threads = [threading.Thread(target=take) for _ in range(12)]
for thread in threads: thread.start()
for thread in threads: thread.join()
with tempfile.NamedTemporaryFile() as file:
    stream = libc.fopen(file.name.encode(), b'w')
    assert libc.malloc_info(0, stream) == 0
    libc.fclose(stream)
    print(file.read().count(b'<heap '))
"""
# Prints the MB that a process holds after it has freed blocks that lie between others.
MANY_GAPS = """
import ctypes, pathlib
from llm_astar_planner.nodes.common import process
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.free.argtypes = ctypes.c_void_p, (ctypes.c_void_p,)
blocks = [libc.malloc(100_000) for _ in range(1000)]
for block in blocks: ctypes.memset(block, 1, 100_000)
for block in blocks[::2]: libc.free(block)
{end}
status = pathlib.Path('/proc/self/status').read_text()
print(int(status.split('VmRSS:')[1].split()[0]) // 1000)
"""


def printed(text):
    done = subprocess.run([sys.executable, '-c', text], capture_output=True, text=True, check=True)
    return int(done.stdout)


def test_threads_share_few_heaps():
    assert printed(MANY_THREADS.format(begin='')) > 2
    assert printed(MANY_THREADS.format(begin='process.limit_heaps()')) <= 2


def test_memory_that_was_freed_between_what_is_held_returns_to_the_system():
    held = printed(MANY_GAPS.format(end=''))
    assert printed(MANY_GAPS.format(end='process.return_freed_memory()')) < held - 40
