"""Build for both worlds: ament_python under colcon, a wheel under pip."""

from setuptools import find_packages, setup

NAME = 'llm_astar_msgs_adapter'

setup(
    name=NAME,
    version='0.1.0',
    description='ROS messages of an LLM-A* planner as plain values, both ways',
    license='Apache-2.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={NAME: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
    ],
    python_requires='>=3.10',
    # The ROS messages come from apt or from the wheels; `make install` picks.
    install_requires=[
        'setuptools',
        'lz4',
        'mcap',
        'numpy',
        'pillow',
        'pyyaml',
        'rosbags',
        'zstandard',
    ],
    extras_require={'test': ['pytest', 'hypothesis']},
    zip_safe=False,
)
