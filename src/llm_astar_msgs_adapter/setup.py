"""Build for both worlds: ament_python under colcon, a wheel under pip."""

from setuptools import setup

NAME = 'llm_astar_msgs_adapter'

setup(
    # colcon cannot read it from setup.cfg.
    python_requires='>=3.10',
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
    ],
)
