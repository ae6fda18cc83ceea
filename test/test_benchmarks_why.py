"""The check of reasons for no path runs, and finds them right."""

from benchmarks.why import main


def test_what_is_named_opens_a_path_and_is_the_least(capsys):
    main(['--problems', '60', '--size', '128', '--rounds', '1'])
    first, *times = capsys.readouterr().out.splitlines()
    assert first == '60 of 60 opened by removing what is named, 60 minimal'
    names = [line.split(':')[0] for line in times]
    assert names == ['walls', 'zone', 'unknown', 'radius', 'radius and zone']
