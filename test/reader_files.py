"""The files that the commands of the documentation take for granted, of our own making."""

from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.source import SourceStatus
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter


def write_movingai(folder):
    """Write x.map and x.map.scen: ten pairs on an empty map, with their optimal lengths."""
    rows = '\n'.join('.' * 40 for _ in range(20))
    (folder / 'x.map').write_text(f'type octile\nheight 20\nwidth 40\nmap\n{rows}\n')
    pairs = [f'0\tx.map\t40\t20\t0\t{y}\t30\t{y}\t30' for y in range(10)]
    (folder / 'x.map.scen').write_text('\n'.join(['version 1', *pairs]) + '\n')


def write_transcript(path):
    """Write a model's answers to all queries of samples_1000.json: the goal itself."""
    writer = TranscriptWriter(path)
    for barrier_map in load_barrier_maps(find_file('samples_1000.json', 'maps')):
        for pair, sample in enumerate(barrier_map.samples):
            text = f'Generated Path: [{list(sample.goal)}]'
            query = (barrier_map.id, pair, 1, 'parrot', 'few_shot', (), text)
            writer.write(Exchange(*query, 7, 5, 0.1, SourceStatus.OK).to_json())
