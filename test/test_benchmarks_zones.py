"""The measurement of zones runs."""

from benchmarks.zones import main


def test_a_line_for_each_configuration_is_printed(capsys):
    main(['--size', '200', '--rounds', '2'])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(':')[0] for line in lines] == ['robot_radius 0', 'robot_radius 0.2']
