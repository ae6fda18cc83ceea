"""Nav2's processes, and planner_node beside them: found, started, watched and ended."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import yaml

FOLDER = Path(__file__).parent
CONFIG = FOLDER.parents[1] / 'config' / 'nav2.yaml'
VARIABLE = 'LLM_ASTAR_NAV2'
MISSING = (
    f"Nav2's executables were not found: source a ROS with navigation2, or name its prefix in "
    f'{VARIABLE}'
)
# Of the stack: packages, executables and, where that is another one, the node's name.
SERVERS = {
    'controller_server': 'nav2_controller',
    'planner_server': 'nav2_planner',
    'behavior_server': 'nav2_behaviors',
    'bt_navigator': 'nav2_bt_navigator',
}
MANAGER = ('nav2_lifecycle_manager', 'lifecycle_manager')
# NavFn and Smac 2D are plug-ins of planner_server, by these parameters.
PLUGINS = {
    'ours': {},
    'navfn': {},
    'smac': {'GridBased.plugin': 'nav2_smac_planner::SmacPlanner2D', 'GridBased.tolerance': '0.5'},
}
PARTS = ('send_goal', 'cancel_goal', 'get_result', 'feedback', 'status')
# What nav2.launch.py moves aside, so that planner_node has these names.
MOVED_ASIDE = [
    *(
        f'{action}/_action/{part}'
        for action in ('compute_path_to_pose', 'compute_path_through_poses')
        for part in PARTS
    ),
    'is_path_valid',
    'plan',
]
OUR_NAMES = {
    'map': 'global_costmap/costmap',
    'map_updates': 'global_costmap/costmap_updates',
    'published_footprint': 'global_costmap/published_footprint',
    'goal_pose': 'llm_astar/goal_pose',
    '/tf': 'tf',
    '/tf_static': 'tf_static',
}
TICKS = os.sysconf('SC_CLK_TCK')
PLANNING = ('planner_server', 'planner_node')


def prefixes():
    """Return the prefixes that may have Nav2: the variable's, then those of a sourced ROS."""
    named = [os.environ.get(VARIABLE, ''), *os.environ.get('AMENT_PREFIX_PATH', '').split(':')]
    return [Path(path) for path in named if path]


def find_executable(package, name):
    """Return the path of an executable of Nav2, None where it is not installed."""
    paths = (prefix / 'lib' / package / name for prefix in prefixes())
    return next((path for path in paths if path.is_file()), None)


def has_nav2():
    pairs = [(package, name) for name, package in SERVERS.items()]
    return all(find_executable(*pair) for pair in [*pairs, MANAGER])


def maps_folder():
    """Return the folder of Nav2's own maps, None where it is not installed."""
    folders = (prefix / 'share/nav2_bringup/maps' for prefix in prefixes())
    return next((folder for folder in folders if folder.is_dir()), None)


def nav2_version():
    for prefix in prefixes():
        package = prefix / 'share/nav2_planner/package.xml'
        if package.is_file():
            return re.search('<version>(.*)</version>', package.read_text())[1]
    return '?'


def environment(domain):
    """Return the environment of a stack in a graph of its own on loopback."""
    changed = {
        'ROS_DOMAIN_ID': str(domain),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'RCUTILS_COLORIZED_OUTPUT': '0',
        'RCUTILS_LOGGING_BUFFERED_STREAM': '0',
        'PYTHONUNBUFFERED': '1',
    }
    prefix = os.environ.get(VARIABLE)
    if prefix:
        version = f'python{sys.version_info.major}.{sys.version_info.minor}'
        for name, path in {
            'AMENT_PREFIX_PATH': prefix,
            'LD_LIBRARY_PATH': f'{prefix}/lib',
            'PYTHONPATH': f'{prefix}/lib/{version}/site-packages',
        }.items():
            before = os.environ.get(name, '').split(':')
            changed[name] = ':'.join([path, *(part for part in before if part not in ('', path))])
    return {**os.environ, **changed}


class Stack:
    """A whole Nav2 with one planner, in the domain of this process; logs go to `folder`."""

    def __init__(self, planner, folder, respawn=True):
        self.planner, self.folder = planner, Path(folder)
        self._respawn, self._closing = respawn, threading.Event()
        self.running, self._spent = {}, {}
        self.folder.mkdir(parents=True, exist_ok=True)
        self._read = {}

    def __enter__(self):
        params = ['--params-file', str(self._parameters())]
        for name, package in SERVERS.items():
            words = [str(find_executable(package, name)), '--ros-args', *params]
            if name == 'planner_server':
                words += self._of_planner_server()
            self.start(name, words)
        if self.planner == 'ours':
            self.start('planner_node', self._planner_node())
            self._manage('lifecycle_manager_llm_astar', 'planner_node')
        self._manage('lifecycle_manager_navigation', *SERVERS)
        threading.Thread(target=self._start_again, daemon=True).start()
        return self

    def __exit__(self, *_):
        self._closing.set()
        for process in self.running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + 10.0
        for process in self.running.values():
            while process.poll() is None and time.monotonic() < deadline:
                time.sleep(0.05)
            process.kill()
            process.wait()

    def _parameters(self):
        """Return the file of Nav2's parameters, for planner_node as nav2.launch.py changes it."""
        if self.planner != 'ours':
            return FOLDER / 'nav2.yaml'
        values = yaml.safe_load((FOLDER / 'nav2.yaml').read_text())
        values['global_costmap']['global_costmap']['ros__parameters']['publish_frequency'] = 2.0
        path = self.folder / 'nav2.yaml'
        path.write_text(yaml.safe_dump(values))
        return path

    def _of_planner_server(self):
        parameters = PLUGINS[self.planner].items()
        words = [word for name, value in parameters for word in ('-p', f'{name}:={value}')]
        if self.planner == 'ours':
            words += remaps({name: f'nav2_planner/{name}' for name in MOVED_ASIDE})
        return words

    def _planner_node(self):
        words = [sys.executable, '-m', 'llm_astar_planner.nodes', 'planner_node', '--ros-args']
        return [*words, '--params-file', str(CONFIG), *remaps(OUR_NAMES)]

    def _manage(self, manager, *names):
        words = [str(find_executable(*MANAGER)), '--ros-args', '-r', f'__node:={manager}']
        listed = '[' + ', '.join(names) + ']'
        self.start(manager, [*words, '-p', 'autostart:=true', '-p', f'node_names:={listed}'])

    def start(self, name, words):
        with (self.folder / f'{name}.log').open('ab') as log:
            self.running[name] = subprocess.Popen(words, stdout=log, stderr=subprocess.STDOUT)
        self.running[name].words = words

    def _start_again(self):
        """Start planner_node, or a killed planner_server, again at once, as the launch does."""
        while not self._closing.wait(0.05):
            for name in PLANNING:
                process = self.running.get(name)
                if self._respawn and process is not None and process.poll() is not None:
                    self.start(name, process.words)

    def kill(self):
        """Kill the process that plans, as a crash or the memory killer would."""
        name = 'planner_node' if self.planner == 'ours' else 'planner_server'
        self.running[name].kill()

    def seconds(self):
        """Return the CPU seconds of each process so far."""
        return {name: cpu_seconds(process.pid) for name, process in self.running.items()}

    def memory(self):
        """Return the MB of memory of each process that plans or holds the global costmap."""
        names = [name for name in PLANNING if name in self.running]
        return {name: resident(self.running[name].pid) for name in names}

    def new_lines(self, name):
        """Return the lines of a log since the last call."""
        path = self.folder / f'{name}.log'
        if not path.is_file():
            return []
        with path.open('rb') as log:
            log.seek(self._read.get(name, 0))
            text = log.read()
            self._read[name] = log.tell()
        return text.decode(errors='replace').splitlines()


def remaps(names):
    return [word for a, b in names.items() for word in ('-r', f'{a}:={b}')]


def cpu_seconds(pid):
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / TICKS


def resident(pid):
    try:
        status = Path(f'/proc/{pid}/status').read_text()
    except OSError:
        return 0.0
    found = re.search(r'VmRSS:\s+(\d+)', status)
    return int(found[1]) / 1024.0 if found else 0.0
