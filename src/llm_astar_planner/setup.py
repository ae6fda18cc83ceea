"""Build for both worlds: ament_python under colcon, a wheel under pip."""

import sys
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

NAME = 'llm_astar_planner'
PAPER = 'https://arxiv.org/abs/2407.02511'
PUBLISHED_CODE = 'https://github.com/SilinMeng0510/llm-astar'
NODES = ('map_node', 'llm_client_node', 'planner_node', 'benchmark_node')

data_files = [
    ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
    (f'share/{NAME}', ['package.xml']),
    (f'share/{NAME}/launch', glob('launch/*.launch.py')),
    (f'share/{NAME}/config', glob('config/*.*')),
    (f'share/{NAME}/config/sros2', glob('config/sros2/*')),
    (f'share/{NAME}/maps', glob('maps/*.json*')),
    (f'share/{NAME}/maps/instructions', glob('maps/instructions/*')),
]
if 'bdist_wheel' in sys.argv:
    # colcon puts the entry points below lib/, where `ros2 run` looks; pip does not.
    data_files.append((f'lib/{NAME}', glob('scripts/*')))
else:
    # And pip puts them into bin/, where a shell looks; colcon does not.
    data_files.append(('bin', ['scripts/llm-astar']))

setup(
    name=NAME,
    version='0.1.0',
    description='A ROS 2 global planner with proven bounds that a language model may guide',
    long_description=(Path(__file__).parent / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    url=PAPER,
    project_urls={'Paper': PAPER, "The paper's code": PUBLISHED_CODE},
    author='The LLM-A* for ROS 2 contributors',
    author_email='maintainers@llm-astar.example',
    license='Apache-2.0',
    keywords=['ROS', 'Nav2', 'path-planning', 'A-star', 'language-model'],
    classifiers=[
        'Development Status :: 4 - Beta',
        'Intended Audience :: Developers',
        'Intended Audience :: Science/Research',
        'License :: OSI Approved :: Apache Software License',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        'Programming Language :: Python :: 3.10',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Programming Language :: Python :: 3.13',
        'Topic :: Scientific/Engineering',
        'Typing :: Typed',
    ],
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: [
            'py.typed',
            'waypoints/prompts/*.txt',
            'instructions/*.json',
            'instructions/model/*.json',
            'instructions/grammar/*.lark',
            'instructions/grammar/vocabulary/*.yaml',
            'waypoints/learned/*.npz',
        ]
    },
    data_files=data_files,
    python_requires='>=3.10',
    # The ROS messages come from apt or from the wheels; `make install` picks.
    install_requires=[
        'setuptools',
        'cachetools',
        'httpx>=0.26',
        # The ROS wheels ask for this name too; lark 1.x is the same import and serves as well.
        'lark-parser',
        'llm_astar_msgs_adapter',
        'numba',
        'numpy',
        'pyyaml',
        'rapidfuzz',
        'scipy',
        'shapely>=2',
        'threadpoolctl',
    ],
    extras_require={
        # `llm-astar mcp`.
        'mcp': ['mcp>=2'],
        'test': [
            'pytest',
            'hypothesis',
            'mcp>=2',
        ],
        # To train the embedded waypoint model again; see training/.
        'train': ['torch>=2.6'],
    },
    entry_points={
        'console_scripts': [
            f'llm-astar = {NAME}.cli.__main__:main',
            *(f'{node} = {NAME}.nodes.__main__:{node}' for node in NODES),
        ]
    },
    zip_safe=False,
)
