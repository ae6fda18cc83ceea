"""The clock of the system jumps while nodes run, and simulated time stands still."""

import contextlib
import json
import shutil
import subprocess
import sys
import threading

import pytest
import rclpy
from graph_tools import DEMO, GOAL, PATIENCE, REPLAY, START, process, running
from llm_astar_planner.nodes.common.entities import Entities
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter

SPACE = '/clock'
# Shifts what a process takes for the time of day by the seconds in a file; all else stays. A wait
# until a time of day is one of the kernel, whose clock does not jump.
SHIFTED_CLOCK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static int64_t none = 0;
static volatile int64_t *shift = &none;
__attribute__((constructor)) static void begin(void) {
    int file = open(getenv("SHIFT_OF_CLOCK"), O_RDONLY);
    if (file >= 0) shift = mmap(0, 8, PROT_READ, MAP_SHARED, file, 0);
}
int clock_gettime(clockid_t clock, struct timespec *now) {
    int failed = syscall(SYS_clock_gettime, clock, now);
    if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) now->tv_sec += *shift;
    return failed;
}
int gettimeofday(struct timeval *now, void *zone) {
    struct timespec precise;
    clock_gettime(CLOCK_REALTIME, &precise);
    now->tv_sec = precise.tv_sec;
    now->tv_usec = precise.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *now) {
    struct timespec precise;
    clock_gettime(CLOCK_REALTIME, &precise);
    if (now) *now = precise.tv_sec;
    return precise.tv_sec;
}
typedef int Wait(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
int pthread_cond_timedwait(
    pthread_cond_t *changed, pthread_mutex_t *lock, const struct timespec *end) {
    static Wait *wait;
    if (!wait) wait = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
    struct timespec until = *end;
    if (until.tv_sec > 100000000) until.tv_sec -= *shift;  /* not of a clock since the start */
    return wait(changed, lock, &until);
}
"""
# Days by which the clock is off, one after the other: it is set back, and forward again. Never
# later than that of the kernel, until which waits would last that are not shifted here.
JUMPS = (0, -400, -1)
DAY = 86_400


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def test_timers_go_on_where_simulated_time_stands_still():
    node = rclpy.create_node(
        'still', namespace=SPACE, parameter_overrides=[Parameter('use_sim_time', value=True)]
    )
    called = threading.Event()
    with running(node):
        Entities(node).timer(0.01, called.set, ReentrantCallbackGroup())
        assert called.wait(PATIENCE)


class ShiftedClock:
    """The time of day of processes that are started with its environment."""

    def __init__(self, folder):
        source, library, self._shift = (folder / name for name in ('c.c', 'c.so', 'shift'))
        source.write_text(SHIFTED_CLOCK)
        subprocess.run(
            [shutil.which('cc'), '-shared', '-fPIC', '-O1', '-o', library, source, '-ldl'],
            check=True,
        )
        self.shift(0)
        self.environment = {'LD_PRELOAD': str(library), 'SHIFT_OF_CLOCK': str(self._shift)}

    def shift(self, seconds):
        mode = 'r+b' if self._shift.exists() else 'wb'
        with self._shift.open(mode) as file:
            file.write(seconds.to_bytes(8, 'little', signed=True))


@pytest.mark.slow
@pytest.mark.skipif(
    not sys.platform.startswith('linux') or shutil.which('cc') is None,
    reason='needs a C compiler, and glibc',
)
def test_calls_are_answered_when_the_systems_clock_jumps(tmp_path, monkeypatch):
    clock = ShiftedClock(tmp_path)
    for name, value in clock.environment.items():
        monkeypatch.setenv(name, value)
    ends = [str(word) for word in ('--start', *START[:2], '--goal', *GOAL[:2])]
    command = [sys.executable, '-m', 'llm_astar_planner.cli.main', 'call', *ends, '--json']
    with contextlib.ExitStack() as stack:
        nodes = [
            stack.enter_context(process(name, namespace=SPACE, files=(DEMO, REPLAY)))
            for name in ('map_node', 'llm_client_node', 'planner_node')
        ]
        for days in JUMPS:
            clock.shift(days * DAY)
            # It waits for the diagnostics first.
            done = subprocess.run(
                [*command, '--namespace', SPACE], capture_output=True, text=True, timeout=PATIENCE
            )
            assert done.returncode == 0, done.stderr
            report = json.loads(done.stdout)['report']
            assert (report['code'], report['warnings']) == (0, [])
            assert report['map_age'] >= 0.0
        assert [node.poll() for node in nodes] == [None] * 3
