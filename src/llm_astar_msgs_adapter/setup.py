"""Build for both worlds: ament_python under colcon, a wheel under pip."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = 'llm_astar_msgs_adapter'
PAPER = 'https://arxiv.org/abs/2407.02511'
PUBLISHED_CODE = 'https://github.com/SilinMeng0510/llm-astar'

setup(
    name=NAME,
    version='0.1.0',
    description='Maps and ROS 2 messages as plain Python values',
    long_description=(Path(__file__).parent / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    url=PAPER,
    project_urls={'Paper': PAPER, "The paper's code": PUBLISHED_CODE},
    author='The LLM-A* for ROS 2 contributors',
    author_email='maintainers@llm-astar.example',
    license='Apache-2.0',
    keywords=['ROS', 'nav_msgs', 'occupancy-grid'],
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
    package_data={NAME: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
    ],
    python_requires='>=3.10',
    # The ROS messages come from apt or from the wheels; `make install` picks.
    install_requires=[
        'setuptools',
        'numpy',
        'pillow',
        'pyyaml',
        'scipy',
        'shapely>=2',
    ],
    extras_require={'test': ['pytest', 'hypothesis']},
    zip_safe=False,
)
