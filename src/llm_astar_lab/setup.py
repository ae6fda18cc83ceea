"""Build for both worlds: ament_python under colcon, a wheel under pip."""

import sys
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

NAME = 'llm_astar_lab'
PAPER = 'https://arxiv.org/abs/2407.02511'
PUBLISHED_CODE = 'https://github.com/SilinMeng0510/llm-astar'

data_files = [
    ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
    (f'share/{NAME}', ['package.xml']),
]
entry_points = {
    # What llm_astar_planner looks up: its extensions.py says what each group is.
    'llm_astar.commands': [f'{NAME} = {NAME}.commands'],
    'llm_astar.nodes': [f'benchmark_node = {NAME}.nodes.benchmark_node:main'],
    'llm_astar.pictures': [
        f'plan = {NAME}.pictures.of_commands:draw_plan',
        f'places = {NAME}.pictures.of_commands:draw_places',
        f'call = {NAME}.nodes.plan_view:PlanView',
    ],
}
if 'bdist_wheel' in sys.argv:
    # colcon puts the entry points below lib/, where `ros2 run` looks; pip does not.
    data_files.append((f'lib/{NAME}', glob('scripts/*')))
else:
    # pip has it in bin/ already, with llm_astar_planner.
    node = 'llm_astar_planner.nodes.__main__:benchmark_node'
    entry_points['console_scripts'] = [f'benchmark_node = {node}']

setup(
    name=NAME,
    version='0.1.0',
    description='Benchmarks, bag evaluation, reports and pictures for llm_astar_planner',
    long_description=(Path(__file__).parent / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    url=PAPER,
    project_urls={'Paper': PAPER, "The paper's code": PUBLISHED_CODE},
    author='The LLM-A* for ROS 2 contributors',
    author_email='maintainers@llm-astar.example',
    license='Apache-2.0',
    keywords=['ROS', 'benchmark', 'path-planning', 'rosbag2', 'language-model'],
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
    package_data={NAME: ['py.typed', 'report/*.j2', 'play/page/*']},
    data_files=data_files,
    python_requires='>=3.10',
    # The ROS messages come from apt or from the wheels; `make install` picks.
    install_requires=[
        'setuptools',
        'cachetools',
        'duckdb',
        'jinja2',
        'llm_astar_msgs_adapter',
        'llm_astar_planner',
        'lz4',
        'matplotlib',
        'mcap',
        'numpy',
        'pillow',
        'pyyaml',
        'rosbags',
        'scipy',
        'shapely>=2',
        'starlette',
        'tqdm',
        'uvicorn',
        'zstandard',
    ],
    extras_require={
        'cluster': ['dask[distributed]'],
        'test': [
            'pytest',
            'hypothesis',
            'mcap-ros2-support',
            'pyarrow',
            # Runs examples/benchmark.ipynb.
            'nbclient',
            'ipykernel',
        ],
    },
    entry_points=entry_points,
    zip_safe=False,
)
