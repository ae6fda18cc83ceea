from benchmarks import jump_points


def test_it_prints_how_much_time_jump_points_take(capsys):
    assert jump_points.main(['--size', '48', '--queries', '1']) == 0
    header, _, *rows = capsys.readouterr().out.splitlines()
    assert header.startswith('| 48 x 48 | jump points per cell')
    names = [row.split(' | ')[0].strip('| ') for row in rows]
    assert {'rooms', 'maze', 'city', 'random 40%'} <= set(names)
    for row in rows:
        share, *ratios = (float(value) for value in row.strip('| ').split(' | ')[1:])
        assert 0.0 <= share < 1.0
        assert all(value > 0.0 for value in ratios)
