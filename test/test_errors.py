"""Every exception class of the packages is an LlmAstarError."""

import importlib
import inspect
import pkgutil

from llm_astar_msgs_adapter.errors import LlmAstarError

import llm_astar_msgs_adapter
import llm_astar_planner


def exception_classes():
    for package in (llm_astar_msgs_adapter, llm_astar_planner):
        for found in pkgutil.walk_packages(package.__path__, f'{package.__name__}.'):
            module = importlib.import_module(found.name)
            for _, value in inspect.getmembers(module, inspect.isclass):
                if value.__module__ == found.name and issubclass(value, Exception):
                    yield value


def test_every_exception_class_derives_from_the_base():
    classes = set(exception_classes())
    assert len(classes) > 10
    assert not {cls for cls in classes if not issubclass(cls, LlmAstarError)}
