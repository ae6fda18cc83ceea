"""What every test runs under: a graph of its own on this machine, and checked message fields."""

import os

import pytest
from hypothesis import HealthCheck, settings

# The same examples every run, on slow machines too: a failure is never a matter of luck.
settings.register_profile(
    'tests',
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile('tests')

# One domain a worker, away from a robot's usual ones; set before anything imports rclpy.
_WORKER = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0')[2:])
os.environ['ROS_DOMAIN_ID'] = str(40 + (os.getpid() + _WORKER) % 60)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'


@pytest.fixture(autouse=True)
def _no_proxies(monkeypatch):
    for name in ('http_proxy', 'https_proxy', 'all_proxy', 'no_proxy'):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)
