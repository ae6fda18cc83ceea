"""The closed loop of the kept way runs."""

from benchmarks.keep_way import main


def test_no_way_changes_without_the_gain_and_every_robot_arrives(capsys):
    assert main(['--runs', '2', '--size', '200', '--obstacles', '4']) == 0
    _, _, newest, kept = capsys.readouterr().out.splitlines()
    for row in (newest, kept):
        assert row.split('|')[2] == '2'
    assert kept.split('|')[7] == '0'
