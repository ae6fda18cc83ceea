"""Build for both worlds: ament_python under colcon, a wheel under pip."""

import sys
from glob import glob

from setuptools import setup

NAME = 'llm_astar_planner'

data_files = [
    ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
    (f'share/{NAME}', ['package.xml']),
    (f'share/{NAME}/launch', glob('launch/*.launch.py')),
    (f'share/{NAME}/config', glob('config/*.*')),
    (f'share/{NAME}/config/sros2', glob('config/sros2/*')),
    (f'share/{NAME}/maps', glob('maps/*.*')),
    (f'share/{NAME}/maps/instructions', glob('maps/instructions/*')),
]
if 'bdist_wheel' in sys.argv:
    # colcon puts the entry points below lib/, where `ros2 run` looks; pip does not.
    data_files.append((f'lib/{NAME}', glob('scripts/*')))
else:
    # And pip puts them into bin/, where a shell looks; colcon does not.
    data_files.append(('bin', ['scripts/llm-astar']))

# colcon cannot read python_requires from setup.cfg.
setup(data_files=data_files, python_requires='>=3.10')
